#include "io/sequence/layouts/frame_files.h"

#include <set>

#include "io/sequence/camera_file.h"
#include "io/sequence/layouts/file_names.h"

namespace felt {
namespace fs = std::filesystem;

std::map<int64_t, fs::path> depth_files(const fs::path& folder, const std::string& prefix, const std::string& infix) {
  for (const std::string& ending : kDepthEndings)
    if (auto files = numbered_files(folder, prefix, {infix + ending}); !files.empty()) return files;
  return {};
}

bool has_depth_files(const fs::path& folder, const std::string& prefix, const std::string& infix) {
  std::vector<std::string> suffixes;
  for (const std::string& ending : kDepthEndings) suffixes.push_back(infix + ending);
  return has_numbered_file(folder, prefix, suffixes);
}

std::vector<FrameRecord> frame_records(const FrameFiles& files, const std::vector<int64_t>& more_numbers) {
  std::set<int64_t> numbers(more_numbers.begin(), more_numbers.end());
  for (const auto* kind : {&files.depth, &files.color, &files.pose})
    for (const auto& [number, file] : *kind) numbers.insert(number);
  std::vector<FrameRecord> frames;
  frames.reserve(numbers.size());
  for (const int64_t number : numbers) {
    FrameRecord frame;
    frame.index = number;
    frame.stamp_s = double(number);
    frame.depth.path = at_number(files.depth, number);
    frame.color.path = at_number(files.color, number);
    frame.labels.path = at_number(files.labels, number);
    frame.instances.path = at_number(files.instances, number);
    frame.probabilities.path = at_number(files.probabilities, number);
    frame.pose_file = at_number(files.pose, number);
    frames.push_back(std::move(frame));
  }
  return frames;
}

void take_camera_file(const fs::path& file, const SequenceOptions& options, SequenceListing& listing) {
  const CameraFile stated = read_camera_file(file);
  if (!options.intrinsics) listing.intrinsics = stated.intrinsics;
  listing.width = stated.width, listing.height = stated.height;
  if (stated.depth_scale > 0) listing.depth_scale = stated.depth_scale;
}

void assume_camera(const Intrinsics& intrinsics, const std::string& file, const std::string& whose,
                   SequenceListing& listing) {
  listing.intrinsics = intrinsics;
  listing.lacking_camera_file = file;
  listing.notes.push_back("no " + file + ": " + whose + " (" + to_string(intrinsics) + ") is assumed");
}

}  // namespace felt
