#include "mapping/store/frame_journal.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <set>
#include <utility>

namespace felt {
namespace {

/// The first half of a recording's name.
std::string images_of(const FusedFrames& run) { return run.sequence.substr(0, 16); }

/// One recording that was read with other poses or stamps.
bool same_images_elsewhere(const FusedFrames& a, const FusedFrames& b) {
  return a.sequence != b.sequence && images_of(a) == images_of(b);
}

}  // namespace

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
  std::set<std::pair<std::string, int64_t>> frames;
  for (const FusedFrames& run_a : a.runs)
    for (const FusedFrames& run_b : b.runs) {
      if (!same_images_elsewhere(run_a, run_b)) continue;
      const std::set<int64_t> in_a(run_a.frames.begin(), run_a.frames.end());
      for (const int64_t index : run_b.frames)
        if (in_a.contains(index)) frames.emplace(images_of(run_a), index);
    }
  return frames.size();
}

bool of_same_images_elsewhere(const FrameJournal& a, const FrameJournal& b) {
  return std::any_of(a.runs.begin(), a.runs.end(), [&](const FusedFrames& run_a) {
    return std::any_of(b.runs.begin(), b.runs.end(),
                       [&](const FusedFrames& run_b) { return same_images_elsewhere(run_a, run_b); });
  });
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
