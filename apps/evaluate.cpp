#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/camera_options.h"
#include "apps/command.h"
#include "apps/commands.h"
#include "apps/exit_code.h"
#include "core/error.h"
#include "io/map_file.h"
#include "io/mesh_io.h"
#include "io/pose_list.h"
#include "mapping/evaluate_geometry.h"
#include "mapping/marching_cubes.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct EvaluateCommand {
  CommonOptions common;
  CameraOptions camera;
  std::string input, reference_mesh, trajectory;
  GeometryOptions geometry;
  ObservingCameras cameras;
};

TriangleMesh mesh_of(const fs::path& path) {
  return path.extension() == ".vdb" ? extract_mesh(load_map(path), {.normals = false, .colors = false})
                                    : read_mesh(path);
}

/// What every figure is, for readers of the JSON.
Json geometry_definitions(const EvaluateCommand& command) {
  const std::string threshold = std::to_string(command.geometry.threshold_m) + " m";
  Json json;
  json["samples"] = "points spread evenly over the area of each mesh (stratified, seed " +
                    std::to_string(command.geometry.seed) + "); distances are exact, to the nearest triangle";
  json["accuracy"] =
      "distance of a sample of the reconstruction to the reference, metres: mean, median, root mean square";
  json["completion"] = "distance of a sample of the reference to the reconstruction, metres: mean, median";
  json["precision"] = "share of samples of the reconstruction nearer than " + threshold + " to the reference";
  json["recall"] =
      "completion ratio: share of samples of the reference nearer than " + threshold + " to the reconstruction";
  json["f_score"] = "harmonic mean of precision and recall";
  json["normal_consistency"] =
      "mean |n . n'| of the triangle normals at a sample and at its nearest point, mean of both directions";
  json["reference_seen"] = command.trajectory.empty()
                               ? "1: every sample of the reference counts (no trajectory given)"
                               : "share of the reference's samples inside the image and depth range of a camera of the "
                                 "trajectory and first on its ray against the reference; only these count";
  return json;
}

int evaluate(EvaluateCommand& command) {
  if (command.reference_mesh.empty())
    throw ConfigError(describe_mismatch("evaluate", "reference", "--reference-mesh", "none"));
  const bool culled = !command.trajectory.empty();
  if (culled) {
    command.cameras.camera = camera_of(command.camera);
    command.cameras.T_world_camera = read_poses(command.trajectory);
  }
  const GeometryScores s = evaluate_geometry(mesh_of(command.input), read_mesh(command.reference_mesh),
                                             command.geometry, culled ? &command.cameras : nullptr);
  Json json;
  json["input"] = command.input;
  json["reference_mesh"] = command.reference_mesh;
  json["threshold_m"] = command.geometry.threshold_m;
  json["samples"] = {{"reconstruction", s.samples_reconstruction}, {"reference", s.samples_reference}};
  json["reference_seen"] = s.reference_seen;
  json["accuracy_m"] = {{"mean", s.accuracy_mean_m}, {"median", s.accuracy_median_m}, {"rms", s.accuracy_rms_m}};
  json["completion_m"] = {{"mean", s.completion_mean_m}, {"median", s.completion_median_m}};
  json["precision"] = s.precision;
  json["recall"] = s.recall;
  json["f_score"] = s.f_score;
  json["normal_consistency"] = s.normal_consistency;
  json["definitions"] = geometry_definitions(command);
  if (command.common.json) {
    std::printf("%s\n", json.dump(2).c_str());
  } else if (!command.common.quiet) {
    std::printf("accuracy            mean %.5f m   median %.5f m   rms %.5f m\n", s.accuracy_mean_m,
                s.accuracy_median_m, s.accuracy_rms_m);
    std::printf("completion          mean %.5f m   median %.5f m   (%.1f %% of the reference counted)\n",
                s.completion_mean_m, s.completion_median_m, 100 * s.reference_seen);
    std::printf("within %.3f m      precision %.4f   recall %.4f   F %.4f\n", command.geometry.threshold_m, s.precision,
                s.recall, s.f_score);
    std::printf("normal consistency  %.4f\n", s.normal_consistency);
  }
  return kDone;
}

}  // namespace

void add_evaluate(CLI::App& app) {
  static EvaluateCommand command;
  CLI::App& sub = add_command(
      app,
      {"evaluate", "Compare a map or mesh with a reference; --json gives the definition of every figure",
       "feltmap evaluate out/map.vdb --reference-mesh scene/mesh.ply\n"
       "feltmap evaluate out/mesh.ply --reference-mesh truth.ply --trajectory traj.txt --max-depth 4 --json"},
      command.common, [] { return evaluate(command); });
  sub.add_option("INPUT", command.input, "Map (.vdb) or mesh (.ply, .obj)")->required()->check(CLI::ExistingFile);
  sub.add_option("--reference-mesh", command.reference_mesh, "Exact mesh (.ply, .obj) in the same world frame")
      ->check(CLI::ExistingFile);
  sub.add_option("--samples", command.geometry.samples, "Samples on each mesh")
      ->check(CLI::Range(size_t(1), size_t(100000000)))
      ->capture_default_str();
  sub.add_option("--seed", command.geometry.seed, "Of the samples")->capture_default_str();
  sub.add_option("--threshold", command.geometry.threshold_m, "Metres, of precision, recall and F-score")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  sub.add_option("--trajectory", command.trajectory,
                 "Poses of the recording, one a line: only what they saw of the reference counts")
      ->check(CLI::ExistingFile);
  add_camera_options(sub, command.camera);
  sub.add_option("--min-depth", command.cameras.min_depth_m, "Metres, of the recording")->capture_default_str();
  sub.add_option("--max-depth", command.cameras.max_depth_m, "Metres, of the recording as fused")
      ->capture_default_str();
}

}  // namespace felt::apps
