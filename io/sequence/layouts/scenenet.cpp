#include <unistd.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "io/files/protobuf.h"
#include "io/files/text_input.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/layouts/frame_files.h"

// SceneNet RGB-D (McCormac et al., ICCV 2017): a folder a trajectory with `photo/`, `depth/` and `instance/`, named by
// frame number; depth in millimetres along the ray of the pixel; poses of all trajectories in protocol buffers
// (scenenet.proto) beside the data.
namespace felt {
namespace fs = std::filesystem;
namespace {

bool recognises(const fs::path& path) {
  return has_numbered_file(path / "photo", "", {".jpg", ".png"}) && has_depth_files(path / "depth");
}

// Field numbers of scenenet.proto.
constexpr uint32_t kTrajectories = 1, kTrajectoryViews = 3, kTrajectoryPath = 4, kViewFrame = 1, kViewOpen = 2,
                   kViewClose = 3, kPoseCamera = 1, kPoseLookAt = 2;

/// Where a view's camera stands and looks at, world (y up), metres.
struct Gaze {
  Eigen::Vector3d camera = Eigen::Vector3d::Zero(), target = Eigen::Vector3d::Zero();
};

Eigen::Vector3d position_of(std::string_view bytes, const ProtobufFile& file) {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  ProtobufMessage message(bytes, file);
  for (ProtobufField field; message.next(field);)
    if (field.number >= 1 && field.number <= 3) position[field.number - 1] = double(field.as_float());
  return position;
}

Gaze gaze_of(std::string_view bytes, const ProtobufFile& file) {
  Gaze gaze;
  for_each_field(bytes, kPoseCamera, file, [&](const auto& f) { gaze.camera = position_of(f.bytes, file); });
  for_each_field(bytes, kPoseLookAt, file, [&](const auto& f) { gaze.target = position_of(f.bytes, file); });
  return gaze;
}

/// Camera to world: z along the gaze, x level, y down. NaN where the gaze has no direction or is plumb.
Eigen::Matrix4d pose_of(const Gaze& gaze) {
  const Eigen::Vector3d forward = (gaze.target - gaze.camera).normalized(),
                        right = forward.cross(Eigen::Vector3d::UnitY()).normalized();
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() << right, forward.cross(right), forward;
  T.topRightCorner<3, 1>() = gaze.camera;
  // Eigen leaves a vector of length 0 as it is; such a pose is none.
  if (right.squaredNorm() < 0.5) T.setConstant(std::numeric_limits<double>::quiet_NaN());
  return T;
}

/// Pose of each view: halfway between the shutter's opening and closing.
std::map<int64_t, Eigen::Matrix4d> poses_of(std::string_view trajectory, const ProtobufFile& file) {
  std::map<int64_t, Eigen::Matrix4d> poses;
  for_each_field(trajectory, kTrajectoryViews, file, [&](const auto& view) {
    int64_t number = 0;
    Gaze open, close;
    for_each_field(view.bytes, kViewFrame, file, [&](const auto& f) { number = int64_t(f.value); });
    for_each_field(view.bytes, kViewOpen, file, [&](const auto& f) { close = open = gaze_of(f.bytes, file); });
    for_each_field(view.bytes, kViewClose, file, [&](const auto& f) { close = gaze_of(f.bytes, file); });
    poses[number] = pose_of({(open.camera + close.camera) / 2, (open.target + close.target) / 2});
  });
  return poses;
}

/// True where `path` ends in the folders of `render_path` ("0/223").
bool ends_in(const fs::path& path, const fs::path& render_path) {
  auto folder = path.end(), name = render_path.end();
  while (name != render_path.begin()) {
    --name;
    if (name->empty()) continue;
    if (folder == path.begin() || *--folder != *name) return false;
  }
  return true;
}

/// Protocol buffers in the folder, in those above it as far as the data set reaches, and in their `*protobufs`.
std::vector<fs::path> protobufs_near(const fs::path& folder) {
  std::vector<fs::path> files;
  const auto add = [&](const fs::path& place) {
    // Folders above are perhaps not the data set's, and not for us to read.
    if (!fs::is_directory(place) || access(place.c_str(), R_OK | X_OK) != 0) return;
    std::vector<fs::path> found;
    for (const fs::path& entry : entries_of(place))
      if (entry.extension() == ".pb") found.push_back(entry);
    std::sort(found.begin(), found.end());
    files.insert(files.end(), found.begin(), found.end());
  };
  fs::path place = folder;
  for (int level = 0; level < 4; ++level, place = place.parent_path()) {
    add(place);
    for (const char* name : {"train_protobufs", "protobufs"}) add(place / name);
  }
  return files;
}

std::map<int64_t, Eigen::Matrix4d> find_poses(const fs::path& folder) {
  const std::vector<fs::path> files = protobufs_near(folder);
  for (const fs::path& path : files) {
    const std::string content = read_whole_file(path, size_t(1) << 32);
    const ProtobufFile file{path.string(), "trajectories", "those of SceneNet RGB-D"};
    std::string_view found;
    for_each_field(content, kTrajectories, file, [&](const auto& trajectory) {
      for_each_field(trajectory.bytes, kTrajectoryPath, file, [&](const auto& render_path) {
        if (found.empty() && ends_in(folder, fs::path(std::string(render_path.bytes)))) found = trajectory.bytes;
      });
    });
    if (!found.empty()) return poses_of(found, file);
  }
  throw FormatError(describe_mismatch(folder.string(), "poses",
                                      "a *.pb of SceneNet RGB-D, here or up to three folders above, with a trajectory "
                                      "whose render_path ends this folder's path",
                                      std::to_string(files.size()) + " files *.pb without one"));
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing;
  listing.frames = frame_records({.depth = depth_files(path / "depth"),
                                  .color = numbered_files(path / "photo", "", {".jpg", ".png"}),
                                  .instances = numbered_files(path / "instance", "", {".png"})});
  const fs::path folder = (fs::absolute(path) / "").lexically_normal().parent_path();
  const std::map<int64_t, Eigen::Matrix4d> poses = find_poses(folder);
  for (FrameRecord& frame : listing.frames)
    if (const auto found = poses.find(frame.index); found != poses.end()) frame.pose = found->second;
  listing.depth_is_ray_length = true;
  if (options.intrinsics) return listing;
  if (const fs::path camera = first_existing(path, {"intrinsics.txt", "camera-intrinsics.txt"}); !camera.empty()) {
    listing.intrinsics = read_camera_file(camera).intrinsics;
  } else {
    // 60 by 45 degrees; the middle of the image lies between its pixels.
    const double fx = 160 / std::tan(M_PI / 6), fy = 120 / std::tan(M_PI / 8);
    listing.intrinsics = Intrinsics{fx, fy, 159.5, 119.5};
    listing.width = 320, listing.height = 240;
  }
  return listing;
}

}  // namespace

const Layout kSceneNetLayout = {"scenenet", "photo/N.jpg and depth/N.png", recognises, list};

}  // namespace felt
