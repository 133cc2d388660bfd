#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "core/text.h"
#include "io/files/text_input.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/layouts/frame_files.h"
#include "io/sequence/skip_reasons.h"
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

/// "first to last" of ascending stamps, `offset` added.
std::string range_text(const std::vector<double>& stamps, double offset = 0) {
  return number_text(stamps.front() + offset, "%.16g") + " to " + number_text(stamps.back() + offset, "%.16g");
}

/// " (stamps of poses in nanoseconds?)" where the two ranges of ascending stamps lie such a factor from each other.
std::string unit_question(const std::vector<double>& depth_stamps, const std::vector<double>& pose_stamps) {
  const double ratio = (pose_stamps.front() + pose_stamps.back()) / (depth_stamps.front() + depth_stamps.back());
  const std::pair<double, const char*> units[] = {{3, "milliseconds"}, {6, "microseconds"}, {9, "nanoseconds"}};
  for (const auto& [digits, unit] : units) {
    if (std::abs(std::log10(ratio) - digits) < 0.5) return std::string(" (stamps of poses in ") + unit + "?)";
    if (std::abs(std::log10(ratio) + digits) < 0.5) return std::string(" (stamps of depth images in ") + unit + "?)";
  }
  return {};
}

/// Says how the stamps lie to each other where most depth images have no pose near enough. Ascending stamps.
void note_stamps_without_pose(const fs::path& trajectory, const std::vector<double>& depth_stamps,
                              const std::vector<double>& pose_stamps, const SequenceOptions& options,
                              SequenceListing& listing) {
  const auto without =
      std::count_if(listing.frames.begin(), listing.frames.end(), [](const FrameRecord& f) { return !f.pose; });
  if (2 * size_t(without) <= listing.frames.size() || depth_stamps.empty() || pose_stamps.empty()) return;
  double least_dt_s = std::numeric_limits<double>::infinity();
  for (const double stamp_s : depth_stamps) {
    const double moment = stamp_s - options.pose_stamp_offset;
    const int64_t nearest = nearest_stamp(pose_stamps, moment, std::numeric_limits<double>::infinity());
    if (nearest >= 0) least_dt_s = std::min(least_dt_s, std::abs(pose_stamps[size_t(nearest)] - moment));
  }
  listing.notes.push_back(describe_mismatch(
      trajectory.string(), "stamps",
      "poses within " + number_text(options.max_dt_s) + " s of the depth images of " + range_text(depth_stamps),
      range_text(pose_stamps, options.pose_stamp_offset) + ": no pose for " + std::to_string(without) + " of " +
          std::to_string(listing.frames.size()) + " images, the smallest difference " +
          number_text(least_dt_s, "%.3g") + " s" + unit_question(depth_stamps, pose_stamps) +
          "; --stamp-offset is added to the stamps of poses, --max-dt allows another difference"));
}

/// Says so where more depth images lack a partner in colour than recording alone explains.
void note_depth_without_color(const SequenceOptions& options, SequenceListing& listing) {
  const auto without = std::count_if(listing.frames.begin(), listing.frames.end(),
                                     [](const FrameRecord& f) { return f.fault == kMissingColor; });
  if (double(without) <= 0.3 * double(listing.frames.size())) return;
  listing.notes.push_back(std::to_string(without) + " of " + std::to_string(listing.frames.size()) +
                          " depth images have no colour image of their own within " + number_text(options.max_dt_s) +
                          " s and are skipped: --no-color uses them without, --max-dt allows another difference");
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

  for (size_t i = 0; i < depth.size(); ++i) {
    FrameRecord frame;
    frame.index = int64_t(i);
    frame.stamp_s = depth[i].stamp_s;
    frame.depth.path = depth[i].path;
    const auto refuse = [&](const std::string& reason, const std::string& what) {
      if (!frame.fault.empty()) return;
      frame.fault = reason;
      frame.fault_detail =
          (path / "depth.txt").string() + ": stamp " + number_text(frame.stamp_s, "%.6f") + ": " + what;
    };
    const std::string within = " within " + number_text(options.max_dt_s) + " s";
    if (disordered[i]) refuse(kStampOutOfOrder, "not after the stamps before it");
    frame.pose = pose_at_stamp(poses, pose_stamps, frame.stamp_s - options.pose_stamp_offset, options.max_dt_s);
    if (!frame.pose) refuse(kMissingPose, "no pose" + within);
    // Colour belongs to one depth image only, the nearest to it: a neighbour's colour would be smeared over this one.
    const int64_t partner = nearest_stamp(color_stamps, frame.stamp_s, options.max_dt_s);
    const int64_t its_depth =
        partner < 0 ? -1 : nearest_stamp(ascending_depth_stamps, color_stamps[size_t(partner)], options.max_dt_s);
    if (its_depth >= 0 && ascending_depth_stamps[size_t(its_depth)] == frame.stamp_s)
      frame.color.path = color[size_t(partner)].path;
    else if (options.read_color && !color.empty())
      refuse(kMissingColor,
             (partner < 0 ? "no colour image" + within : "the nearest colour image belongs to another depth image") +
                 " (--no-color does without)");
    listing.frames.push_back(std::move(frame));
  }
  note_stamps_without_pose(path / "groundtruth.txt", ascending_depth_stamps, pose_stamps, options, listing);
  note_depth_without_color(options, listing);
  const fs::path camera =
      first_existing(path, {"camera-intrinsics.txt", "intrinsics.txt", "camera.yaml", "calibration.txt"});
  // Only YAML can state more than the intrinsics that were given.
  if (!camera.empty() && (!options.intrinsics || camera.extension() == ".yaml")) {
    take_camera_file(camera, options, listing);
  } else if (!options.intrinsics) {
    assume_camera({525, 525, 319.5, 239.5}, "camera-intrinsics.txt",
                  "the TUM benchmark's default for registered images", listing);
  }
  return listing;
}

}  // namespace

const Layout kTumLayout = {"tum", "depth.txt and groundtruth.txt (and rgb.txt)", recognises, list};

}  // namespace felt
