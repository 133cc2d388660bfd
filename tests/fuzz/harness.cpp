#include "tests/fuzz/harness.h"

#include <stdlib.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>

#include "core/error.h"
#include "core/frame_selection.h"
#include "io/images/depth_decode.h"
#include "io/images/image_decode.h"
#include "io/images/image_encode.h"
#include "io/map_file/map_file.h"
#include "io/map_file/map_trailer.h"
#include "io/meshes/mesh_io.h"
#include "io/readings/fit_priors.h"
#include "io/readings/friction_log.h"
#include "io/readings/infer_json.h"
#include "io/readings/points.h"
#include "io/readings/touch_json.h"
#include "io/readings/touches.h"
#include "io/segmentation/network.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/lidar_scan.h"
#include "io/sequence/open_sequence.h"
#include "io/sequence/pose_list.h"
#include "io/sequence/trajectory_file.h"
#include "io/settings/reconstruct_config.h"
#include "io/simulation/scene_file.h"
#include "io/tables/class_table_file.h"
#include "io/tables/confusion_file.h"
#include "io/tables/property_yaml.h"
#include "mapping/maps/map_verify.h"

namespace felt::fuzz {
namespace {
namespace fs = std::filesystem;

/// A folder of this process, removed at its end.
const fs::path& scratch_folder() {
  static const struct Folder {
    Folder() {
      std::string name = (fs::temp_directory_path() / "feltmap-fuzz-XXXXXX").string();
      if (mkdtemp(name.data()) == nullptr) std::abort();
      path = name;
    }
    ~Folder() {
      std::error_code fault;
      fs::remove_all(path, fault);
    }
    fs::path path;
  } folder;
  return folder.path;
}

/// The bytes as a file, for readers that take a path.
fs::path as_file(const std::string& name, const std::string& bytes) {
  const fs::path path = scratch_folder() / name;
  std::ofstream(path, std::ios::binary | std::ios::trunc).write(bytes.data(), std::streamsize(bytes.size()));
  return path;
}

std::span<const uint8_t> as_image(const std::string& bytes) {
  return {reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()};
}

/// Not an Error: a reader that contradicts itself is a finding.
void require(bool condition, const char* what) {
  if (!condition) throw std::logic_error(what);
}

/// Runs several readers over the same bytes; refused where all refuse.
template <typename... Reads>
void any_of(Reads... reads) {
  int refused = 0;
  const auto attempt = [&](auto read) {
    try {
      read();
    } catch (const Error&) {
      if (++refused == int(sizeof...(reads))) throw;
    }
  };
  (attempt(reads), ...);
}

const ClassTable& classes() {
  static const ClassTable table({{0, "none", {}, true}, {1, "wood", {}, false}, {2, "ice", {}, false}});
  return table;
}

void read_classes(const std::string& name, const std::string& bytes) {
  const ClassTable table = read_class_table(as_file(name, bytes));
  require(read_class_table(as_file("written.yaml", class_table_yaml(table))) == table,
          "a class table changes when written");
}
void read_classes_csv(const std::string& bytes) { read_classes("classes.csv", bytes); }
void read_classes_yaml(const std::string& bytes) { read_classes("classes.yaml", bytes); }
void read_camera(const std::string& bytes) { read_camera_file(as_file("camera.txt", bytes)); }
void read_config(const std::string& bytes) { read_reconstruct_config(as_file("config.yaml", bytes)); }
void read_confusion(const std::string& bytes) { parse_confusion_matrix(bytes, classes(), "confusion.csv"); }
void read_frames(const std::string& bytes) { parse_frame_selection(bytes, "--frames"); }
void read_obj(const std::string& bytes) { parse_obj(bytes, "mesh.obj"); }
void read_ply(const std::string& bytes) { parse_ply(bytes, "mesh.ply"); }
void read_point_list(const std::string& bytes) { read_points(as_file("points.csv", bytes)); }
void read_priors(const std::string& bytes) { fit_priors_json(read_readings_csv(as_file("readings.csv", bytes)), 100); }
void read_scene_yaml(const std::string& bytes) {
  const Scene scene = parse_scene(bytes, "scene.yaml");
  require(parse_scene(scene_json(scene, "{}"), "written").name == scene.name, "a scene changes when written");
}
void read_touches_csv(const std::string& bytes) { parse_touches(bytes, "touches.csv"); }

void read_depth(const std::string& bytes) { decode_depth(as_image(bytes), "depth"); }

void read_friction(const std::string& bytes) { friction_reading(parse_force_log(bytes, "log.csv"), {}); }

void read_image(const std::string& bytes) {
  any_of([&] { read_image_header(as_image(bytes), "image"); }, [&] { decode_gray16(as_image(bytes), "image"); },
         [&] { decode_color(as_image(bytes), "image"); });
}

void read_infer(const std::string& bytes) {
  const InferAnswer answer = infer_json_line(bytes, 1);
  require(!answer.json.empty() && answer.json.find('\n') == std::string::npos, "not one line of JSON");
  if (answer.failed) throw FormatError(answer.json);
}

/// The content of a map file behind a checksum that is right, which damage alone never gives.
void read_map(const std::string& bytes) {
  MapTrailer trailer;
  trailer.add(bytes.data(), bytes.size());
  verify(load_map(as_file("map.vdb", bytes + trailer.finish(kMapFileVersion))));
}

void read_poses_text(const std::string& bytes) {
  const fs::path path = as_file("poses.txt", bytes);
  any_of([&] { read_poses(path); }, [&] { read_trajectory(path, true); }, [&] { read_trajectory(path, false); },
         [&] { read_pose_file(path); });
}

void read_properties_yaml(const std::string& bytes) {
  const PropertyTable table = parse_properties(bytes, "properties.yaml");
  require(parse_properties(properties_yaml(table), "written") == table, "a property table changes when written");
}

/// Opens the sequence and reads its first frames.
void read_frames_of(const fs::path& path, const std::string& format) {
  SequenceOptions options;
  options.format = format;
  const auto sequence = open_sequence(path, options);
  for (int64_t i = 0; i < std::min<int64_t>(3, sequence->size()); ++i) sequence->read(i);
}

void read_sens(const std::string& bytes) { read_frames_of(as_file("scan.sens", bytes), "sens"); }

/// A picture of 8 x 6 pixels, written once.
void write_view(const fs::path& file) {
  if (fs::exists(file)) return;
  fs::create_directories(file.parent_path());
  write_bytes(file, encode_png(Image<uint16_t>(8, 6, 1500)));
}

void read_apc_info(const std::string& bytes) {
  write_view(scratch_folder() / "apc" / "frame-000000.depth.png");
  as_file("apc/cam.info.txt", bytes);
  read_frames_of(scratch_folder() / "apc", "apc");
}

void read_redwood_log(const std::string& bytes) {
  write_view(scratch_folder() / "redwood" / "depth" / "0.png");
  as_file("redwood/intrinsic.txt", "5 5 3.5 2.5\n");
  as_file("redwood/trajectory.log", bytes);
  read_frames_of(scratch_folder() / "redwood", "redwood");
}

/// Points, and one of the views that are made of them: a coarse one, for 512 x 512 pixels take a quarter of a second.
void read_scan(const std::string& bytes) {
  const std::vector<Eigen::Vector3f> points = decode_scan(as_image(bytes), "scan.bin");
  depth_of_scan(points, int(points.size()) % kScanFaces, {16, 16, 15.5, 15.5, 32, 32});
}

/// One scan that has a pose.
void read_kitti_calibration(const std::string& bytes) {
  fs::create_directories(scratch_folder() / "kitti");
  as_file("kitti/000000.bin", std::string(16, '\0'));
  as_file("kitti/poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  as_file("kitti/calib.txt", bytes);
  open_sequence(scratch_folder() / "kitti", {});
}

void read_net(const std::string& bytes) {
  as_file("net.onnx", "");
  read_net_description(as_file("net.yaml", bytes));
}

/// Edges of the graph and whether they fit a description; what runs a network is another library.
void read_onnx(const std::string& bytes) {
  NetDescription net;
  net.file = as_file("net.onnx", bytes);
  net.described_in = "net.yaml";
  net.backend = NetBackend::opencv;
  net.classes = {"wood", "ice"};
  load_net_model(net);
}

/// One view of 8 x 6 pixels; the bytes are the poses beside it.
void read_scenenet(const std::string& bytes) {
  const fs::path folder = scratch_folder() / "scenenet" / "0" / "7";
  write_view(folder / "depth" / "0.png");
  write_view(folder / "photo" / "0.png");
  as_file("scenenet/0/7/intrinsics.txt", "5 5 3.5 2.5\n");
  as_file("scenenet/poses.pb", bytes);
  read_frames_of(folder, "scenenet");
}

void read_tum_lists(const std::string& bytes) {
  write_view(scratch_folder() / "tum" / "depth" / "1.png");
  as_file("tum/camera-intrinsics.txt", "5 5 3.5 2.5\n");
  as_file("tum/groundtruth.txt", "1 0 0 0 0 0 0 1\n");
  as_file("tum/depth.txt", bytes);
  as_file("tum/rgb.txt", bytes);
  read_frames_of(scratch_folder() / "tum", "tum");
}

/// One view of 8 x 6 pixels below the description.
void read_sequence_yaml(const std::string& bytes) {
  const fs::path folder = scratch_folder() / "sequence";
  write_view(folder / "depth" / "0.png");
  as_file("sequence/poses.txt", "0 1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1\n");
  as_file("sequence/sequence.yaml", bytes);
  read_frames_of(folder, "generic");
}

void read_touch_journal(const std::string& bytes) {
  const TouchJournal journal = parse_touch_journal(bytes, "touch journal");
  const std::string text = touch_journal_json(journal);
  require(touch_journal_json(parse_touch_journal(text, "written")) == text, "a touch journal changes when written");
}

// Decoders keep buffers of a fixed size. Text: a word of a few bytes may become a node of a document or a row of
// numbers. Images: a byte of deflate is up to 1032 bytes, which are eight pixels each at one bit a pixel, which are
// four bytes each as colour.
constexpr size_t kFree = size_t(16) << 20, kText = 2000, kImage = size_t(1032) * 8 * 6;
// Map: a leaf of 130 bytes becomes planes of up to 4 KiB; the journal may name ten million frames in a few bytes.
constexpr size_t kMapFree = size_t(128) << 20, kMap = 200;

constexpr Harness kHarnesses[] = {
    {"apc_info", read_apc_info, kFree, kText},
    {"camera", read_camera, kFree, kText},
    {"classes_csv", read_classes_csv, kFree, kText},
    {"classes_yaml", read_classes_yaml, kFree, kText},
    {"config", read_config, kFree, kText},
    {"confusion", read_confusion, kFree, kText},
    {"depth", read_depth, kFree, kImage},
    {"frames", read_frames, kFree, kText},
    {"friction", read_friction, kFree, kText},
    {"image", read_image, kFree, kImage},
    {"infer", read_infer, kFree, kText},
    {"kitti_calibration", read_kitti_calibration, kFree, kText},
    {"map", read_map, kMapFree, kMap},
    {"net", read_net, kFree, kText},
    {"obj", read_obj, kFree, kText},
    {"onnx", read_onnx, kFree, kText},
    {"ply", read_ply, kFree, kText},
    {"points", read_point_list, kFree, kText},
    {"poses", read_poses_text, kFree, kText},
    {"priors", read_priors, kFree, kText},
    {"properties", read_properties_yaml, kFree, kText},
    {"redwood_log", read_redwood_log, kFree, kText},
    {"scan", read_scan, kFree, kText},
    {"scene", read_scene_yaml, kFree, kText},
    {"scenenet", read_scenenet, kFree, kText},
    {"sens", read_sens, kFree, kImage},
    {"sequence", read_sequence_yaml, kFree, kText},
    {"touch_journal", read_touch_journal, kFree, kText},
    {"touches", read_touches_csv, kFree, kText},
    {"tum_lists", read_tum_lists, kFree, kText},
};

}  // namespace

std::span<const Harness> harnesses() { return kHarnesses; }

bool accepted(const Harness& harness, const std::string& bytes) {
  try {
    harness.read(bytes);
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace felt::fuzz
