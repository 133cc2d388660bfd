#include "io/doctor/file_check.h"

#include <algorithm>
#include <fstream>
#include <limits>
#include <map>
#include <system_error>
#include <variant>

#include "io/sequence/recorded_pose.h"
#include "io/sequence/skip_reasons.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// True where both sources hold the same bytes.
bool same_bytes(const ImageSource& a, const ImageSource& b) {
  if (a.face != b.face) return false;  // the four views of a scan come from one file
  const uint64_t size = stored_bytes(a);
  if (size == 0 || size != stored_bytes(b)) return false;
  std::ifstream file_a(a.path, std::ios::binary), file_b(b.path, std::ios::binary);
  file_a.seekg(std::streamoff(a.offset));
  file_b.seekg(std::streamoff(b.offset));
  char chunk_a[1 << 14], chunk_b[1 << 14];
  for (uint64_t left = size; left > 0;) {
    const auto count = std::streamsize(std::min<uint64_t>(left, sizeof chunk_a));
    if (!file_a.read(chunk_a, count) || !file_b.read(chunk_b, count)) return false;
    if (!std::equal(chunk_a, chunk_a + count, chunk_b)) return false;
    left -= uint64_t(count);
  }
  return true;
}

/// Numbers that a regular numbering would have and this one lacks; empty where the numbering is not regular.
std::vector<int64_t> numbers_missing(const std::vector<FrameRecord>& frames) {
  std::map<int64_t, size_t> steps;
  for (size_t i = 1; i < frames.size(); ++i) ++steps[frames[i].index - frames[i - 1].index];
  std::vector<int64_t> missing;
  if (frames.size() < 8) return missing;
  const auto usual =
      std::max_element(steps.begin(), steps.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (usual->second < 0.75 * double(frames.size() - 1)) return missing;
  constexpr size_t kMost = 10000;
  for (size_t i = 1; i < frames.size(); ++i)
    for (int64_t n = frames[i - 1].index + usual->first; n < frames[i].index && missing.size() < kMost;
         n += usual->first)
      missing.push_back(n);
  return missing;
}

/// Of a recording that lacks no depth image, what becomes of its frames: `reasons` as counted, not empty.
std::string unused_text(const std::map<std::string, int64_t>& reasons, size_t frames) {
  int64_t skipped = 0, colorless = 0;
  for (const auto& [reason, count] : reasons) {
    skipped += count;
    if (reason == kMissingColor) colorless = count;
  }
  std::string text = "every depth image is there; " + std::to_string(skipped) + " of " + std::to_string(frames) +
                     " frames are skipped";
  if (colorless == 0) return text;
  if (colorless < skipped) text += ", " + std::to_string(colorless) + " of them";
  return text + " as they have no colour of their own (--no-color uses them)";
}

}  // namespace

Finding check_frames(const SequenceListing& listing) {
  const std::vector<FrameRecord>& frames = listing.frames;
  std::error_code fault;
  std::map<std::string, int64_t> reasons;
  std::vector<int64_t> without_depth;
  for (const FrameRecord& frame : frames) {
    const auto pose = recorded_pose(frame);
    if (frame.depth.empty() || !fs::exists(frame.depth.path, fault))
      without_depth.push_back(frame.index);
    else if (const auto* problem = std::get_if<PoseProblem>(&pose); problem != nullptr)
      ++reasons[problem->reason];
    else if (!frame.fault.empty())
      ++reasons[frame.fault];
  }
  const std::vector<int64_t> gaps = numbers_missing(frames);
  const auto share = [&](const char* reason) {
    return reasons.contains(reason) ? double(reasons.at(reason)) / double(frames.size()) : 0.0;
  };
  // Lost tracking and images without a partner belong to recording; more than that does not.
  const bool many_poses_missing = share(kMissingPose) > 0.15 || share(kNonFinitePose) > 0.3;
  const bool disordered = share(kStampOutOfOrder) > 0, unreadable = share(kUnreadablePose) > 0,
             not_rigid = share(kNonRigidPose) > 0, partnerless = share(kMissingColor) > 0.3;
  Finding finding{"frames",
                  !without_depth.empty() || !gaps.empty() || many_poses_missing || disordered || unreadable ||
                      not_rigid || partnerless,
                  0.95,
                  "all frames are there",
                  "",
                  ""};
  finding.evidence = std::to_string(frames.size()) + " frames, numbers " + std::to_string(frames.front().index) +
                     " to " + std::to_string(frames.back().index);
  if (!reasons.empty()) finding.evidence += ", " + skipped_text(reasons);
  if (!without_depth.empty()) {
    finding.belief = std::to_string(without_depth.size()) + " frames lack their depth image";
    finding.evidence += "; frames " + frames_text(without_depth);
  } else if (!gaps.empty()) {
    finding.belief = std::to_string(gaps.size()) + " frames are missing from an otherwise regular numbering";
    finding.evidence += "; numbers " + frames_text(gaps);
  } else if (finding.faulty) {
    finding.belief = "frames cannot be used for the reasons counted";
  } else if (!reasons.empty()) {
    finding.belief = unused_text(reasons, frames.size());
  }
  // What the layout found out about stamps that do not meet says more than counts do.
  const auto of_stamps = std::find_if(listing.notes.begin(), listing.notes.end(), [](const std::string& note) {
    return note.find("--stamp-offset") != std::string::npos;
  });
  if (many_poses_missing && of_stamps != listing.notes.end()) {
    finding.evidence += "; " + *of_stamps;
    finding.remedy = "bring the stamps of poses and depth images together: --stamp-offset, or --max-dt";
  } else if (partnerless && listing.stamped)
    finding.remedy =
        "--max-dt with a larger difference where colour lies farther from depth; --no-color where there is less of it";
  else if (many_poses_missing && frames.front().depth.codec == ImageSource::Codec::scan)
    finding.remedy =
        "add poses.txt with a line of 12 numbers for each scan (docs/datasets.md): scans without are skipped";
  else if (finding.faulty)
    finding.remedy = "copy the recording again if these frames should be there; else they are skipped and counted";
  return finding;
}

namespace {

/// Views of nothing and of a wall straight ahead, which repeat themselves while the camera moves.
bool all_alike(const DepthImage& depth_m) {
  float least = std::numeric_limits<float>::infinity(), most = 0;
  for (const float z : depth_m)
    if (z > 0) least = std::min(least, z), most = std::max(most, z);
  return most <= least * 1.0001f;
}

/// Whether a frame's images are those of the frame before, and no camera that moves would see that.
bool repeats(const FrameRecord& before, const FrameRecord& frame, int64_t position, const SequenceReader& depth) {
  const bool same_depth = same_bytes(before.depth, frame.depth), same_color = same_bytes(before.color, frame.color);
  if (!same_depth && !same_color) return false;
  const ReadResult result = depth.read(position);
  const auto* decoded = std::get_if<Frame>(&result);
  if (decoded == nullptr) return std::get<SkippedFrame>(result).reason != kDepthAllZero;
  if (same_depth && (same_color || frame.color.empty())) return !all_alike(decoded->depth_m);
  // One of the two alone: plain surfaces without noise, which take few bytes, look alike from many places.
  constexpr double kPlainBytesPerPixel = 0.05;
  return double(stored_bytes(same_depth ? frame.depth : frame.color)) >=
         kPlainBytesPerPixel * double(decoded->depth_m.width()) * double(decoded->depth_m.height());
}

}  // namespace

Finding check_copies(const SequenceListing& listing, const SequenceReader& depth) {
  const std::vector<FrameRecord>& frames = listing.frames;
  std::vector<int64_t> copies;
  for (size_t i = 1; i < frames.size(); ++i)
    if (repeats(frames[i - 1], frames[i], int64_t(i), depth)) copies.push_back(frames[i].index);
  Finding finding{"duplicates", !copies.empty(), 0.99, "no image is a copy of the one before", "", ""};
  finding.evidence = "files of " + std::to_string(frames.size()) + " frames compared";
  if (copies.empty()) return finding;
  finding.belief = std::to_string(copies.size()) + " frames repeat the image of the frame before";
  finding.evidence = "equal bytes in frames " + frames_text(copies);
  finding.remedy = "leave them out with --frames, or record again";
  return finding;
}

}  // namespace felt
