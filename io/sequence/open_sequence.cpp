#include "io/sequence/open_sequence.h"

#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "io/files/text_input.h"
#include "io/images/image_decode.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/listed_sequence.h"
#include "io/sequence/probability_images.h"
#include "io/sequence/recorded_pose.h"
#include "io/sequence/side_images.h"
#include "io/sequence/trajectory_file.h"
#include "io/tables/class_table_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

const Layout& layout_named(const std::string& name) {
  if (name == "open3d") return kRedwoodLayout;
  for (const Layout& layout : all_layouts())
    if (name == layout.name) return layout;
  throw ConfigError(
      describe_mismatch("--format", "layout", "one of " + listed(all_layouts(), &Layout::name), "'" + name + "'"));
}

/// The layout that `path` is to be read as. ScanNet is distributed as containers and as folders exported from them.
const Layout& layout_named(const std::string& name, const fs::path& path) {
  if (name == "scannet" && !kScanNetLayout.recognises(path) && kSensLayout.recognises(path)) return kSensLayout;
  return layout_named(name);
}

/// What lies directly in a folder, by ending: "4 files *.bag, 3 folders"; says so where they are recordings of ROS.
std::string contents_of(const fs::path& path) {
  if (!fs::is_directory(path)) return "a file '" + path.filename().string() + "'";
  std::map<std::string, int> kinds;
  std::error_code fault;
  bool of_ros = false;
  for (fs::directory_iterator at(path, fault), end; !fault && at != end; at.increment(fault)) {
    const std::string ending = at->path().extension().string();
    of_ros |= ending == ".bag" || ending == ".mcap" || ending == ".db3";
    ++kinds[at->is_directory(fault) ? "folders" : ending.empty() ? "files without an ending" : "*" + ending];
  }
  std::string text = listed(kinds, [](const auto& kind) { return std::to_string(kind.second) + " " + kind.first; });
  if (text.empty()) text = "an empty folder";
  return of_ros ? text + " (ROS recordings are not read: export their images and poses first)" : text;
}

const Layout& detect_layout(const fs::path& path) {
  std::string looked_for;
  for (const Layout& layout : all_layouts()) {
    if (layout.recognises(path)) return layout;
    looked_for += std::string(looked_for.empty() ? "" : "; ") + layout.name + ": " + layout.looks_for;
  }
  throw FormatError(describe_mismatch(path.string(), "sequence", looked_for, "none of these but " + contents_of(path)));
}

/// The path without what hides its folder: a slash at its end, "." and "..".
fs::path without_detours(const fs::path& path) {
  fs::path clean = (path / "").lexically_normal().parent_path();
  if (clean.empty() || clean.filename() == "." || clean.filename() == "..")
    clean = (fs::absolute(path) / "").lexically_normal().parent_path();
  return clean;
}

SequenceListing list_as_recorded(const fs::path& given, const SequenceOptions& options) {
  const fs::path path = without_detours(given);
  std::error_code fault;
  if (!fs::exists(path, fault))
    throw IoError(describe_mismatch(path.string(), "sequence", "a folder or file", "nothing"));
  if (fs::is_directory(path)) {
    fs::directory_iterator(path, fault);
    if (fault) throw IoError(describe_mismatch(path.string(), "sequence", "a readable folder", fault.message()));
  }
  const Layout& layout = options.format.empty() ? detect_layout(path) : layout_named(options.format, path);
  SequenceListing listing = layout.list(path, options);
  listing.layout = layout.name;
  if (listing.frames.empty())
    throw FormatError(
        describe_mismatch(path.string(), std::string(layout.name) + " sequence", layout.looks_for, "no frames"));
  return listing;
}

/// Adds `offset` to the stamps of the poses: each frame takes the pose between its new neighbours. Frames whose new
/// moment is not within the trajectory have none. Layouts with a trajectory of its own rate do it themselves.
void shift_poses(double offset, SequenceListing& listing) {
  std::vector<StampedPose> poses;
  std::vector<double> stamps;
  for (const FrameRecord& frame : listing.frames) {
    const auto recorded = recorded_pose(frame);
    if (!std::holds_alternative<Eigen::Isometry3d>(recorded)) continue;
    if (!std::isfinite(frame.stamp_s) || (!stamps.empty() && frame.stamp_s <= stamps.back())) continue;
    poses.push_back({frame.stamp_s, std::get<Eigen::Isometry3d>(recorded).matrix(), 0});
    stamps.push_back(frame.stamp_s);
  }
  for (FrameRecord& frame : listing.frames) {
    const double moment = frame.stamp_s - offset;
    frame.pose_file.clear();
    frame.pose.reset();
    if (stamps.empty() || !(moment >= stamps.front() && moment <= stamps.back())) continue;
    frame.pose = pose_at_stamp(poses, stamps, moment, std::numeric_limits<double>::infinity());
  }
}

/// The table that lies with a folder of label images: in it, or beside it under its name (`material/` and
/// `classes_material.csv`). Empty where there is none.
fs::path table_of_labels(const fs::path& folder) {
  const fs::path clean = (folder / "").lexically_normal().parent_path();
  if (const fs::path inside = first_existing(clean, {"classes.yaml", "classes.csv"}); !inside.empty()) return inside;
  const std::string name = clean.filename().string();
  return first_existing(clean.parent_path(), {"classes_" + name + ".yaml", "classes_" + name + ".csv"});
}

/// The table that was given, else that of the labels that were given, else the sequence's own. Probability maps that
/// the layout found keep their classes by name.
void choose_class_table(const SequenceOptions& options, SequenceListing& listing) {
  fs::path file = options.classes_file;
  if (file.empty() && !options.labels_dir.empty()) file = table_of_labels(options.labels_dir);
  if (file.empty()) return;
  const ClassTable own = std::exchange(listing.classes, read_class_table(file));
  if (!options.probs_dir.empty()) return;
  std::map<uint16_t, uint16_t> id_in_table;
  for (const ClassInfo& theirs : own.classes())
    for (const ClassInfo& ours : listing.classes.classes())
      if (ours.name == theirs.name) id_in_table[theirs.id] = ours.id;
  for (FrameRecord& frame : listing.frames)
    for (ClassMap& map : frame.class_maps) {
      const auto found = id_in_table.find(map.class_id);
      if (found == id_in_table.end())
        throw ConfigError(describe_mismatch(file.string(), "class of " + map.image.path.filename().string(),
                                            "a class of that name", "none"));
      map.class_id = found->second;
    }
}

/// Whether the first depth image that can be read holds floating-point numbers, which are metres unless said otherwise.
bool holds_floats(const SequenceListing& listing) {
  for (const FrameRecord& frame : listing.frames) {
    if (frame.depth.empty()) continue;
    if (frame.depth.codec != ImageSource::Codec::image_file || frame.depth.path.extension() == ".png") return false;
    try {
      const std::string bytes = read_whole_file(frame.depth.path);
      return read_image_header({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()},
                               frame.depth.path.string())
          .floating;
    } catch (const Error&) {
      continue;  // that frame is skipped and counted when it is read
    }
  }
  return false;
}

void apply_options(const SequenceOptions& options, SequenceListing& listing) {
  if (options.intrinsics) {
    listing.intrinsics = options.intrinsics;
    // The user's word against the camera file's size too; containers of raw values need their own.
    if (listing.frames.front().depth.codec == ImageSource::Codec::image_file) listing.width = listing.height = 0;
  }
  if (options.depth_scale)
    listing.depth_scale = *options.depth_scale;
  else if (!listing.depth_scale_stated && holds_floats(listing))
    listing.depth_scale = 1;
  if (options.depth_encoding) listing.depth_encoding = *options.depth_encoding;
  if (options.depth_is_ray_length) listing.depth_is_ray_length = *options.depth_is_ray_length;
  if (options.distortion) listing.distortion = *options.distortion;
  if (options.T_body_camera) listing.T_body_camera = *options.T_body_camera;
  if (options.pose_convention) listing.pose_convention = *options.pose_convention;
  if (options.pose_stamp_offset != 0 && listing.layout != kTumLayout.name)
    shift_poses(options.pose_stamp_offset, listing);
  if (!(listing.depth_scale > 0 && listing.depth_scale < 1e9))
    throw ConfigError(describe_mismatch("depth scale", "units per metre", "a number above 0 and below 1000000000",
                                        number_text(listing.depth_scale)));
  choose_class_table(options, listing);
  const bool labelled = std::any_of(listing.frames.begin(), listing.frames.end(),
                                    [](const FrameRecord& frame) { return !frame.labels.empty(); });
  if (labelled && listing.classes.empty() && options.labels_dir.empty())
    listing.notes.push_back("label images without a class table: they are not used (--classes FILE names one)");
  if (!options.labels_dir.empty()) attach_labels(options.labels_dir, listing);
  if (!options.probs_dir.empty()) attach_probabilities(options.probs_dir, listing);
  if (!options.instances_dir.empty()) attach_instances(options.instances_dir, listing);
  if (listing.classes.empty() && !(options.labels_dir.empty() && options.probs_dir.empty()))
    throw ConfigError(describe_mismatch((options.labels_dir.empty() ? options.probs_dir : options.labels_dir).string(),
                                        "class table",
                                        "one in the folder, beside it, in the sequence, or by --classes FILE", "none"));
}

/// Runs a step and turns the standard library's complaint about a file into ours.
template <typename Step>
auto with_io_errors(Step step) {
  try {
    return step();
  } catch (const fs::filesystem_error& fault) {
    throw IoError(fault.path1().string() + ": " + fault.code().message());
  }
}

}  // namespace

std::span<const Layout> all_layouts() {
  static const Layout layouts[] = {kGenericLayout,     kTumLayout,      kReplicaLayout, kApcLayout,
                                   kSevenScenesLayout, kSensLayout,     kScanNetLayout, kRedwoodLayout,
                                   kIclLayout,         kSceneNetLayout, kLidarLayout};
  return layouts;
}

void require_layout(const std::string& name) { layout_named(name); }

SequenceListing list_sequence(const fs::path& path, const SequenceOptions& options) {
  return with_io_errors([&] {
    SequenceListing listing = list_as_recorded(path, options);
    apply_options(options, listing);
    return listing;
  });
}

std::unique_ptr<SequenceReader> open_sequence(const fs::path& path, const SequenceOptions& options) {
  return with_io_errors([&] { return make_listed_sequence(path, options, list_sequence(path, options)); });
}

}  // namespace felt
