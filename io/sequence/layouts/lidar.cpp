#include <algorithm>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/lidar_scan.h"
#include "io/sequence/trajectory_file.h"

// Scans of a turning range sensor as KITTI stores them: one file of points each, `poses.txt` with the 12 numbers of a
// pose a line and, as KITTI's poses are those of its camera 0, `calib.txt` with `Tr:` from the sensor to that camera.
namespace felt {
namespace fs = std::filesystem;
namespace {

fs::path scan_folder(const fs::path& path) { return fs::is_directory(path / "velodyne") ? path / "velodyne" : path; }

std::vector<fs::path> scans_of(const fs::path& path) {
  if (fs::is_regular_file(path)) return {path};
  std::vector<fs::path> scans;
  for (const fs::path& entry : entries_of(scan_folder(path)))
    if (entry.extension() == ".bin") scans.push_back(entry);
  // By number where names end in one, else by name.
  std::sort(scans.begin(), scans.end(), [](const fs::path& a, const fs::path& b) {
    const auto n = trailing_number(a.stem().string()), m = trailing_number(b.stem().string());
    return n && m && *n != *m ? *n < *m : a < b;
  });
  return scans;
}

bool recognises(const fs::path& path) {
  if (fs::is_regular_file(path)) return path.extension() == ".bin";
  return !scans_of(path).empty();
}

/// `Tr:` of calib.txt, identity where there is none.
Eigen::Matrix4d sensor_to_camera(const fs::path& folder) {
  const fs::path file = folder / "calib.txt";
  if (!fs::exists(file)) return Eigen::Matrix4d::Identity();
  const std::string content = read_whole_file(file, 1 << 20);
  LineReader lines(content, file);
  while (lines.next()) {
    if (!lines.line().starts_with("Tr:")) continue;
    const std::vector<double> numbers = parse_numbers(lines.line().substr(3), lines.where());
    if (numbers.size() != 12)
      throw FormatError(describe_mismatch(lines.where(), "Tr", "12 numbers", std::to_string(numbers.size())));
    return matrix_of_numbers(numbers.data(), 12);
  }
  return Eigen::Matrix4d::Identity();
}

/// Ranges of a scan have neither lens nor scale, and its faces turn with it: options about those would do nothing or
/// harm.
void refuse_camera_options(const SequenceOptions& options) {
  const std::pair<bool, const char*> given[] = {{options.intrinsics.has_value(), "--intrinsics"},
                                                {options.depth_scale.has_value(), "--depth-scale"},
                                                {options.depth_encoding.has_value(), "--depth-encoding"},
                                                {options.depth_is_ray_length.value_or(false), "--ray-length"},
                                                {options.distortion.has_value(), "--distortion"},
                                                {options.T_body_camera.has_value(), "--body-camera"},
                                                {options.pose_convention.has_value(), "--pose-convention"},
                                                {options.pose_stamp_offset != 0, "--stamp-offset"}};
  for (const auto& [is_given, option] : given)
    if (is_given)
      throw ConfigError(describe_mismatch(option, "sequence", "images of a camera", "scans of a turning range sensor"));
}

/// Line of poses.txt of each scan: the number in its name where all are in the file, as where only some scans of a
/// recording are there, else its position.
std::vector<size_t> pose_lines(const std::vector<fs::path>& scans, size_t poses) {
  std::vector<size_t> by_number, by_position;
  for (const fs::path& scan : scans) {
    const auto number = trailing_number(scan.stem().string());
    if (number && *number >= 0 && size_t(*number) < poses) by_number.push_back(size_t(*number));
    by_position.push_back(by_position.size());
  }
  return by_number.size() == scans.size() ? by_number : by_position;
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  refuse_camera_options(options);
  SequenceListing listing;
  const std::vector<fs::path> scans = scans_of(path);
  const fs::path folder = fs::is_regular_file(path) ? path.parent_path() : path;
  std::vector<StampedPose> poses;
  const fs::path file = fs::is_regular_file(path) ? fs::path() : first_existing(folder, {"poses.txt"});
  if (!file.empty()) {
    poses = read_trajectory(file, false);
    const Eigen::Matrix4d Tr = sensor_to_camera(folder);
    for (StampedPose& pose : poses) pose.matrix = pose.matrix * Tr;
  } else {
    // How the others lie to it nobody knows: they are skipped, and counted, for want of a pose.
    poses.push_back({0, Eigen::Matrix4d::Identity(), 0});
    listing.notes.push_back(scans.size() == 1 ? "a single scan without a pose: the sensor is the origin, z up"
                                              : "no poses.txt: only the first of " + std::to_string(scans.size()) +
                                                    " scans is used, the sensor is the origin, z up");
  }
  const std::vector<size_t> lines = file.empty() ? pose_lines(scans, 0) : pose_lines(scans, poses.size());
  for (size_t i = 0; i < scans.size(); ++i)
    for (int face = 0; face < kScanFaces; ++face) {
      FrameRecord frame;
      frame.index = int64_t(i) * kScanFaces + face;
      frame.stamp_s = double(frame.index);
      frame.depth = {scans[i], 0, 0, ImageSource::Codec::scan, face};
      if (lines[i] < poses.size()) frame.pose = poses[lines[i]].matrix * T_scan_face(face).matrix();
      listing.frames.push_back(std::move(frame));
    }
  const PinholeCamera camera = scan_face_camera();
  listing.intrinsics = Intrinsics{camera.fx, camera.fy, camera.cx, camera.cy};
  listing.width = camera.width, listing.height = camera.height;
  listing.depth_scale = 1;
  listing.voxel_size_m = 0.2, listing.max_depth_m = 80;
  return listing;
}

}  // namespace

const Layout kLidarLayout = {"lidar", "KITTI scans *.bin (one file, or a folder with poses.txt)", recognises, list};

}  // namespace felt
