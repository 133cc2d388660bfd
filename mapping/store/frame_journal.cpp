#include "mapping/store/frame_journal.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <utility>

namespace felt {

void record_frame(FrameJournal& journal, const std::string& sequence, const std::string& settings, int64_t index) {
  if (journal.runs.empty() || journal.runs.back().sequence != sequence || journal.runs.back().settings != settings)
    journal.runs.push_back({sequence, settings, {}});
  journal.runs.back().frames.push_back(index);
}

size_t frame_count(const FrameJournal& journal) {
  size_t n = 0;
  for (const FusedFrames& run : journal.runs) n += run.frames.size();
  return n;
}

std::vector<std::pair<std::string, int64_t>> shared_frames(const FrameJournal& a, const FrameJournal& b) {
  const auto all = [](const FrameJournal& journal) {
    std::set<std::pair<std::string, int64_t>> frames;
    for (const FusedFrames& run : journal.runs)
      for (const int64_t index : run.frames) frames.emplace(run.sequence, index);
    return frames;
  };
  const auto in_a = all(a), in_b = all(b);
  std::vector<std::pair<std::string, int64_t>> shared;
  std::set_intersection(in_a.begin(), in_a.end(), in_b.begin(), in_b.end(), std::back_inserter(shared));
  return shared;
}

size_t frames_of_same_images(const FrameJournal& a, const FrameJournal& b) {
  const auto images = [](const FusedFrames& run) { return run.sequence.substr(0, 16); };
  std::set<std::pair<std::string, int64_t>> frames;
  for (const FusedFrames& run_a : a.runs)
    for (const FusedFrames& run_b : b.runs) {
      if (run_a.sequence == run_b.sequence || images(run_a) != images(run_b)) continue;
      const std::set<int64_t> in_a(run_a.frames.begin(), run_a.frames.end());
      for (const int64_t index : run_b.frames)
        if (in_a.contains(index)) frames.emplace(images(run_a), index);
    }
  return frames.size();
}

FrameJournal joined(const FrameJournal& a, const FrameJournal& b) {
  std::map<std::pair<std::string, std::string>, std::vector<int64_t>> runs;
  for (const FrameJournal* journal : {&a, &b})
    for (const FusedFrames& run : journal->runs) {
      std::vector<int64_t>& frames = runs[{run.sequence, run.settings}];
      frames.insert(frames.end(), run.frames.begin(), run.frames.end());
    }
  FrameJournal result;
  for (auto& [key, frames] : runs) {
    std::sort(frames.begin(), frames.end());
    result.runs.push_back({key.first, key.second, std::move(frames)});
  }
  return result;
}

}  // namespace felt
