#include "io/sequence/camera_file.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/layouts/frame_files.h"
#include "io/sequence/side_images.h"
#include "io/tables/class_table_file.h"

// Exports with a folder for each kind of file and one pose file a frame: ICL-NUIM as fused by many, ScanNet's exporter.
namespace felt {
namespace fs = std::filesystem;
namespace {

const std::vector<std::string> kDepthCamera = {"intrinsic/intrinsic_depth.txt", "intrinsics_depth.txt"},
                               kColorCamera = {"intrinsic/intrinsic_color.txt", "intrinsics_color.txt"},
                               kOneCamera = {"intrinsics.txt", "camera-intrinsics.txt", "intrinsic.txt"},
                               kLabelFolders = {"labels", "label", "label-filt", "semantic"},
                               kTables = {"classes.yaml", "labels_40.csv", "classes.csv"};

bool has_frames(const fs::path& path) {
  return has_depth_files(path / "depth") && has_numbered_file(path / "pose", "", {".txt"});
}
bool recognises_scannet(const fs::path& path) {
  return has_frames(path) && !first_existing(path, kDepthCamera).empty();
}
bool recognises_icl(const fs::path& path) { return has_frames(path) && first_existing(path, kDepthCamera).empty(); }

SequenceListing list_frames(const fs::path& path) {
  SequenceListing listing;
  listing.frames = frame_records({.depth = depth_files(path / "depth"),
                                  .color = numbered_files(path / "color", "", {".jpg", ".png", ".jpeg"}),
                                  .pose = numbered_files(path / "pose", "", {".txt"})});
  if (const fs::path labels = first_existing(path, kLabelFolders); has_numbered_file(labels, "", {".png"}))
    attach_labels(labels, listing);
  else if (!labels.empty())
    listing.notes.push_back(labels.string() + ": no PNG images named by frame number: not used as labels");
  if (const fs::path table = first_existing(path, kTables); !table.empty()) listing.classes = read_class_table(table);
  return listing;
}

SequenceListing list_scannet(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing = list_frames(path);
  const fs::path depth_camera = first_existing(path, kDepthCamera), color_camera = first_existing(path, kColorCamera);
  if (!options.intrinsics && !depth_camera.empty()) listing.intrinsics = read_camera_file(depth_camera).intrinsics;
  if (!color_camera.empty()) {
    const CameraFile file = read_camera_file(color_camera);
    listing.color_intrinsics = file.intrinsics;
    listing.color_width = file.width, listing.color_height = file.height;
  }
  return listing;
}

SequenceListing list_icl(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing = list_frames(path);
  if (options.intrinsics) return listing;
  if (const fs::path camera = first_existing(path, kOneCamera); !camera.empty()) {
    listing.intrinsics = read_camera_file(camera).intrinsics;
  } else {
    assume_camera({481.2, 480, 319.5, 239.5}, "intrinsics.txt", "the camera of ICL-NUIM", listing);
  }
  return listing;
}

}  // namespace

const Layout kScanNetLayout = {"scannet", "depth/N.png, pose/N.txt and intrinsic/intrinsic_depth.txt",
                               recognises_scannet, list_scannet};
const Layout kIclLayout = {"icl", "depth/N.png and pose/N.txt", recognises_icl, list_icl};

}  // namespace felt
