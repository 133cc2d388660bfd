#include <algorithm>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/layouts/frame_files.h"
#include "io/sequence/trajectory_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

const std::vector<std::string> kTrajectories = {"trajectory.log", "traj.log", "scene/trajectory.log", "odometry.log"},
                               kCameras = {"intrinsic.json", "camera_intrinsic.json", "intrinsics.json",
                                           "intrinsic.txt"};

bool recognises(const fs::path& path) {
  return !first_existing(path, kTrajectories).empty() && has_depth_files(path / "depth");
}

/// Open3D's log: per pose a line of three numbers, the first its frame's position, and four lines of a matrix.
std::vector<StampedPose> read_log(const fs::path& file) {
  const std::string content = read_whole_file(file);
  std::vector<StampedPose> poses;
  LineReader lines(content, file);
  while (lines.next()) {
    StampedPose pose;
    pose.line = lines.number();
    const std::vector<double> ids = parse_numbers(lines.line(), lines.where());
    if (ids.size() != 3 || !(ids[0] >= 0 && ids[0] < 1e15))
      throw FormatError(describe_mismatch(lines.where(), "pose", "a line of three numbers before each matrix",
                                          std::to_string(ids.size()) + " numbers"));
    pose.stamp_s = ids[0];
    for (int row = 0; row < 4; ++row) {
      const bool more = lines.next();
      const std::vector<double> numbers = more ? parse_numbers(lines.line(), lines.where()) : std::vector<double>();
      if (numbers.size() != 4)
        throw FormatError(describe_mismatch(lines.where(), "row " + std::to_string(row + 1) + " of the matrix",
                                            "4 numbers",
                                            more ? std::to_string(numbers.size()) : "the end of the file"));
      for (int column = 0; column < 4; ++column) pose.matrix(row, column) = numbers[size_t(column)];
    }
    poses.push_back(pose);
  }
  return poses;
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing;
  const fs::path log = first_existing(path, kTrajectories);
  std::map<int64_t, Eigen::Matrix4d> pose_at;
  for (const StampedPose& pose : read_log(log))
    if (!pose_at.emplace(int64_t(pose.stamp_s), pose.matrix).second)
      throw FormatError(describe_mismatch(log.string() + ":" + std::to_string(pose.line), "frame", "each once",
                                          std::to_string(int64_t(pose.stamp_s)) + " again"));
  const fs::path color_folder = fs::exists(path / "color") ? path / "color" : path / "image";
  listing.frames = frame_records(
      {.depth = depth_files(path / "depth"), .color = numbered_files(color_folder, "", {".jpg", ".png"})});
  // The log counts from 0, whatever number the first image has: by numbers, so that a missing image shifts no pose, and
  // by position where numbers have gaps that the log does not know. Colour alone is no frame.
  const int64_t first = listing.frames.empty() ? 0 : listing.frames.front().index;
  std::erase_if(listing.frames, [](const FrameRecord& frame) { return frame.depth.empty(); });
  const auto all_have_poses = [&](int64_t before) {
    return std::all_of(listing.frames.begin(), listing.frames.end(),
                       [&](const FrameRecord& frame) { return pose_at.contains(frame.index - before); });
  };
  // A log that ends with the last image's own number is of the same count: images before the first are missing.
  const bool same_count = all_have_poses(0) && !pose_at.empty() && !listing.frames.empty() &&
                          pose_at.rbegin()->first == listing.frames.back().index;
  const int64_t before = same_count ? 0 : first;
  const bool by_number = all_have_poses(before);
  if (!same_count && first > 0 && by_number && pose_at.size() != listing.frames.size())
    listing.notes.push_back("the first depth image has number " + std::to_string(first) +
                            " and is taken for pose 0 of " + log.filename().string() + ", which has " +
                            std::to_string(pose_at.size()) + " poses for " + std::to_string(listing.frames.size()) +
                            " images");
  for (size_t i = 0; i < listing.frames.size(); ++i) {
    const auto found = pose_at.find(by_number ? listing.frames[i].index - before : int64_t(i));
    if (found != pose_at.end()) listing.frames[i].pose = found->second;
  }
  if (!by_number && pose_at.size() != listing.frames.size())
    listing.notes.push_back(std::to_string(listing.frames.size()) + " depth images and " +
                            std::to_string(pose_at.size()) + " poses in " + log.filename().string() +
                            ": they are taken to go together in order, from the first on");
  if (const fs::path camera = first_existing(path, kCameras); !camera.empty()) {
    take_camera_file(camera, options, listing);
  } else if (!options.intrinsics) {
    assume_camera({525, 525, 319.5, 239.5}, "intrinsic.json", "Open3D's default camera", listing);
  }
  return listing;
}

}  // namespace

const Layout kRedwoodLayout = {"redwood", "depth/N.png and trajectory.log", recognises, list};

}  // namespace felt
