#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/trajectory_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

struct StampedFile {
  double stamp_s = 0;
  fs::path path;
};

bool recognises(const fs::path& path) { return fs::exists(path / "depth.txt") && fs::exists(path / "groundtruth.txt"); }

/// Reads lines of "stamp file".
std::vector<StampedFile> read_file_list(const fs::path& list) {
  const std::string content = read_whole_file(list);
  std::vector<StampedFile> files;
  LineReader lines(content, list);
  while (lines.next()) {
    const std::string_view line = lines.line();
    const auto words = split_words(line);
    const auto stamp = words.size() >= 2 ? parse_number(words[0]) : std::nullopt;
    if (!stamp)
      throw FormatError(
          describe_mismatch(lines.where(), "line", "'stamp file'", "'" + std::string(line.substr(0, 60)) + "'"));
    // The rest of the line, so that names may hold blanks.
    files.push_back({*stamp, list.parent_path() / std::string(line.substr(size_t(words[1].data() - line.data())))});
  }
  return files;
}

/// Ascending order of stamps, for look-up only: partners may be listed in any order.
template <typename T>
std::vector<double> sort_by_stamp(std::vector<T>& items) {
  std::erase_if(items, [](const T& item) { return !(item.stamp_s == item.stamp_s); });
  std::stable_sort(items.begin(), items.end(), [](const T& a, const T& b) { return a.stamp_s < b.stamp_s; });
  std::vector<double> stamps;
  for (const T& item : items) stamps.push_back(item.stamp_s);
  return stamps;
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing;
  listing.depth_scale = 5000;
  listing.stamped = true;
  const std::vector<StampedFile> depth = read_file_list(path / "depth.txt");
  std::vector<StampedFile> color;
  if (fs::exists(path / "rgb.txt")) color = read_file_list(path / "rgb.txt");
  std::vector<StampedPose> poses = read_trajectory(path / "groundtruth.txt", true);

  std::vector<double> depth_stamps;
  for (const StampedFile& file : depth) depth_stamps.push_back(file.stamp_s);
  const std::vector<bool> disordered = out_of_order(depth_stamps);
  std::vector<double> ascending_depth_stamps = depth_stamps;
  std::erase_if(ascending_depth_stamps, [](double stamp_s) { return std::isnan(stamp_s); });
  std::sort(ascending_depth_stamps.begin(), ascending_depth_stamps.end());
  const std::vector<double> color_stamps = sort_by_stamp(color), pose_stamps = sort_by_stamp(poses);

  const auto stamp_text = [](double stamp_s) {
    char text[40];
    std::snprintf(text, sizeof text, "%.6f", stamp_s);
    return std::string(text);
  };
  for (size_t i = 0; i < depth.size(); ++i) {
    FrameRecord frame;
    frame.index = int64_t(i);
    frame.stamp_s = depth[i].stamp_s;
    frame.depth.path = depth[i].path;
    const auto refuse = [&](const std::string& reason, const std::string& what) {
      if (!frame.fault.empty()) return;
      frame.fault = reason;
      frame.fault_detail = (path / "depth.txt").string() + ": stamp " + stamp_text(frame.stamp_s) + ": " + what;
    };
    const std::string within = " within " + std::to_string(options.max_dt_s) + " s";
    if (disordered[i]) refuse("stamp out of order", "not after the stamps before it");
    frame.pose = pose_at_stamp(poses, pose_stamps, frame.stamp_s - options.pose_stamp_offset, options.max_dt_s);
    if (!frame.pose) refuse("missing pose", "no pose" + within);
    // Colour belongs to one depth image only, the nearest to it: a neighbour's colour would be smeared over this one.
    const int64_t partner = nearest_stamp(color_stamps, frame.stamp_s, options.max_dt_s);
    const int64_t its_depth =
        partner < 0 ? -1 : nearest_stamp(ascending_depth_stamps, color_stamps[size_t(partner)], options.max_dt_s);
    if (its_depth >= 0 && ascending_depth_stamps[size_t(its_depth)] == frame.stamp_s)
      frame.color.path = color[size_t(partner)].path;
    else if (options.read_color && !color.empty())
      refuse("missing colour image",
             partner < 0 ? "no colour image" + within : "the nearest colour image belongs to another depth image");
    listing.frames.push_back(std::move(frame));
  }
  if (!options.intrinsics) {
    const fs::path camera =
        first_existing(path, {"camera-intrinsics.txt", "intrinsics.txt", "camera.yaml", "calibration.txt"});
    if (!camera.empty()) {
      const CameraFile file = read_camera_file(camera);
      listing.intrinsics = file.intrinsics;
      listing.width = file.width, listing.height = file.height;
      if (file.depth_scale > 0) listing.depth_scale = file.depth_scale;
    } else {
      listing.intrinsics = Intrinsics{525, 525, 319.5, 239.5};
      listing.notes.push_back(
          "no camera file: the TUM benchmark's default for registered images (525, 525, 319.5, 239.5) is assumed");
    }
  }
  return listing;
}

}  // namespace

const Layout kTumLayout = {"tum", "depth.txt and groundtruth.txt (and rgb.txt)", recognises, list};

}  // namespace felt
