#include <numeric>

#include "core/error.h"
#include "io/sequence/layouts.h"
#include "io/sequence/layouts/file_names.h"
#include "io/sequence/layouts/frame_files.h"
#include "io/sequence/trajectory_file.h"
#include "io/tables/class_table_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

/// Frame numbers that may be absent: a stray file name must not make us list a million empty frames.
constexpr int64_t kMostGaps = 10000;

bool recognises(const fs::path& path) {
  return fs::exists(path / "traj.txt") && has_depth_files(path / "results", "depth");
}

SequenceListing list(const fs::path& path, const SequenceOptions& options) {
  SequenceListing listing;
  listing.depth_scale = 6553.5;
  const FrameFiles files{.depth = depth_files(path / "results", "depth"),
                         .color = numbered_files(path / "results", "frame", {".jpg", ".png"}),
                         .labels = numbered_files(path / "semantic", "semantic", {".png"}),
                         .instances = numbered_files(path / "instance", "instance", {".png"})};
  const std::vector<StampedPose> poses = read_trajectory(path / "traj.txt", false);
  // Line n of traj.txt belongs to frame n, so a frame without images shows as a missing one.
  int64_t count = int64_t(poses.size());
  for (const auto* kind : {&files.depth, &files.color})
    if (!kind->empty()) count = std::max(count, kind->rbegin()->first + 1);
  if (count > int64_t(poses.size() + files.depth.size()) + kMostGaps)
    throw FormatError(
        describe_mismatch(path.string(), "frame numbers", "numbers near those of traj.txt", std::to_string(count - 1)));
  std::vector<int64_t> numbers(static_cast<size_t>(count));
  std::iota(numbers.begin(), numbers.end(), int64_t(0));
  listing.frames = frame_records(files, numbers);
  for (size_t i = 0; i < poses.size(); ++i) listing.frames[i].pose = poses[i].matrix;
  const fs::path camera = first_existing(path, {"cam_params.json"}).empty()
                              ? first_existing(path.parent_path(), {"cam_params.json"})
                              : path / "cam_params.json";
  if (!camera.empty()) {
    take_camera_file(camera, options, listing);
  } else if (!options.intrinsics) {
    assume_camera({600, 600, 599.5, 339.5}, "cam_params.json", "the camera of Replica", listing);
  }
  if (const fs::path table = first_existing(path, {"classes.yaml", "classes_semantic.csv"}); !table.empty())
    listing.classes = read_class_table(table);
  return listing;
}

}  // namespace

const Layout kReplicaLayout = {"replica", "traj.txt and results/depthNNNNNN.png", recognises, list};

}  // namespace felt
