#include <cmath>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/layouts/frame_files.h"
#include "io/tables/class_table_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

const std::vector<std::string> kColor = {".color.png", ".color.jpg", ".color.jpeg"}, kPose = {".pose.txt"},
                               kLabels = {".segm.png", ".label.png"};
constexpr const char *kPrefix = "frame-", *kDepth = ".depth";
constexpr Intrinsics kDepthCamera = {585, 585, 320, 240};

/// The folder that holds the frames: `path` or its only `seq-*`.
fs::path frame_folder(const fs::path& path) {
  if (has_depth_files(path, kPrefix, kDepth)) return path;
  if (!fs::is_directory(path)) return {};
  std::vector<fs::path> sequences;
  for (const fs::path& entry : entries_of(path))
    if (entry.filename().string().starts_with("seq-") && has_depth_files(entry, kPrefix, kDepth))
      sequences.push_back(entry);
  if (sequences.size() > 1)
    throw FormatError(describe_mismatch(path.string(), "sequence", "one folder seq-*; name the one to read",
                                        std::to_string(sequences.size()) + " of them"));
  return sequences.empty() ? fs::path() : sequences.front();
}

/// Whether the camera's file says that colour lies on the grid of depth (`convert` writes it so).
bool says_registered(const fs::path& camera) {
  return !camera.empty() && read_whole_file(camera).starts_with(kRegisteredMark);
}

bool is_depth_camera(const Intrinsics& k) {
  return k.fx == kDepthCamera.fx && k.fy == kDepthCamera.fy && k.cx == kDepthCamera.cx && k.cy == kDepthCamera.cy;
}

/// Whether a camera that was said is that of the recording's file, the depth camera of 7-Scenes, with a focal length
/// that was measured better.
bool refines(const Intrinsics& said, const fs::path& camera) {
  if (camera.empty() || std::abs(said.fx / kDepthCamera.fx - 1) > 0.1) return false;
  try {
    return is_depth_camera(read_camera_file(camera).intrinsics);
  } catch (const FormatError&) {
    return false;  // the user says another because of it
  }
}

bool recognises(const fs::path& path) {
  const fs::path folder = frame_folder(path);
  return !folder.empty() && !fs::exists(folder / "cam.info.txt");  // poses in one file: another layout
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing;
  const fs::path folder = frame_folder(path);
  listing.frames = frame_records({.depth = depth_files(folder, kPrefix, kDepth),
                                  .color = numbered_files(folder, kPrefix, kColor),
                                  .labels = numbered_files(folder, kPrefix, kLabels),
                                  .pose = numbered_files(folder, kPrefix, kPose)});
  const fs::path above = folder.parent_path();
  fs::path camera;
  for (const fs::path& place : {folder, above}) {
    if (camera.empty()) camera = first_existing(place, {"camera-intrinsics.txt", "camera-intrinsics.color.txt"});
  }
  if (!options.intrinsics) {
    if (!camera.empty()) {
      listing.intrinsics = read_camera_file(camera).intrinsics;
    } else {
      assume_camera(kDepthCamera, "camera-intrinsics.txt", "the depth camera of 7-Scenes", listing);
    }
  }
  // Microsoft's recordings: depth is not registered to colour, whose camera has another focal length. How the cameras
  // lie to each other was not published; a few pixels are left.
  const Intrinsics depth_camera = options.intrinsics ? *options.intrinsics : *listing.intrinsics;
  if ((is_depth_camera(depth_camera) || (options.intrinsics && refines(*options.intrinsics, camera))) &&
      !says_registered(camera))
    listing.color_intrinsics = Intrinsics{525, 525, 320, 240};
  for (const fs::path& place : {folder, above})
    if (const fs::path table = first_existing(place, {"classes.yaml"}); !table.empty() && listing.classes.empty())
      listing.classes = read_class_table(table);
  // The picking challenge's recordings share these names but rotate the depth bits and count 0.1 mm.
  if (camera.filename() == "camera-intrinsics.color.txt") {
    listing.depth_encoding = DepthEncoding::rotated3;
    listing.depth_scale = 10000;
    listing.voxel_size_m = 0.005;
    listing.notes.push_back(
        "camera-intrinsics.color.txt marks a picking-challenge recording: depth is read as rotated3, 0.1 mm");
  }
  return listing;
}

}  // namespace

const Layout kSevenScenesLayout = {"7scenes", "frame-NNNNNN.depth.png with .pose.txt, here or in seq-*/", recognises,
                                   list};

}  // namespace felt
