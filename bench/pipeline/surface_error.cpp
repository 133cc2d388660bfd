// Distance of mesh vertices to the true surface, by distance model and weight, and how much of what was seen the mesh
// covers: the table behind the defaults.
//   bench_surface_error [voxel_size_m]
#include <cmath>
#include <functional>
#include <numeric>

#include "bench/support/bench.h"
#include "core/simd.h"
#include "io/meshes/mesh_io.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_library.h"
#include "mapping/evaluation/mesh_distance.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/surface/marching_cubes.h"

namespace {

using namespace felt;

struct Case {
  std::string name;
  std::vector<Frame> frames;
  std::function<std::vector<float>(const std::vector<Eigen::Vector3f>&)> error_m;  ///< distance to the true surface
  std::vector<Eigen::Vector3f> seen;  ///< points of the true surface that were seen
};

/// Every 97th pixel of exact views, in the world.
std::vector<Eigen::Vector3f> seen_points(const std::vector<Frame>& exact, float max_depth_m) {
  std::vector<Eigen::Vector3f> points;
  for (const Frame& frame : exact)
    for (size_t i = 0; i < frame.depth_m.size(); i += 97) {
      const float d = frame.depth_m.data()[i];
      if (!(d > 0.1f && d < max_depth_m)) continue;
      const int u = int(i) % frame.depth_m.width(), v = int(i) / frame.depth_m.width();
      points.push_back((frame.T_world_camera * (double(d) * frame.camera.ray(u, v))).cast<float>());
    }
  return points;
}

void measure(const Case& scene, double voxel) {
  const char* const distances[] = {"optical-axis", "ray", "tangent-plane"};
  const char* const weights[] = {"constant", "inverse-square", "sensor-noise"};
  for (int distance = 0; distance < 3; ++distance)
    for (int weight = 0; weight < 3; ++weight) {
      IntegrationConfig config;
      config.distance = DistanceModel(distance), config.weight = WeightModel(weight);
      Map map(voxel, 4 * voxel);
      IntegrationScratch scratch;
      for (const Frame& frame : scene.frames) integrate(map, frame, config, scratch);
      const TriangleMesh mesh = extract_mesh(map);
      std::vector<float> error = scene.error_m(mesh.positions);
      const double mean = std::accumulate(error.begin(), error.end(), 0.0) / double(error.size());
      std::nth_element(error.begin(), error.begin() + long(error.size() * 95 / 100), error.end());
      const double p95 = error[error.size() * 95 / 100];
      const std::vector<float> missing = distances_to_mesh(scene.seen, TriangleTree(mesh));
      const auto near = std::count_if(missing.begin(), missing.end(), [&](float d) { return d < voxel; });
      std::printf("| %s | %s | %s | %.4f | %.3f | %.1f %% | %zu |\n", scene.name.c_str(), distances[distance],
                  weights[weight], mean / voxel, p95 / voxel, 100 * double(near) / double(missing.size()),
                  mesh.positions.size());
      std::fflush(stdout);
    }
}

Case rendered_house() {
  const TriangleTree truth(read_mesh(bench::recorded("house_living_rendered") / "gt_mesh.ply"));
  Case house{"rendered house",
             bench::decoded("house_living_rendered"),
             [truth](const auto& points) { return distances_to_mesh(points, truth); },
             {}};
  house.seen = seen_points(house.frames, 3.9f);
  return house;
}

Case simulated(bool noisy) {
  const Scene scene = make_scene("room1");
  RenderOptions options;
  options.with_color = false;
  const Trajectory path = standard_trajectory(scene, 60);
  Case room{std::string("room1, ") + (noisy ? "sensor noise" : "exact depth"),
            render_sequence(scene, path, simulated_camera(), options),
            [scene](const auto& points) {
              std::vector<float> error;
              for (const auto& p : points)
                error.push_back(std::abs(float(signed_distance_m(scene, p.template cast<double>()))));
              return error;
            },
            {}};
  room.seen = seen_points(room.frames, 3.9f);
  options.noise = DepthNoise{};
  if (noisy) room.frames = render_sequence(scene, path, simulated_camera(), options);
  return room;
}

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  const double voxel = argc > 1 ? std::atof(argv[1]) : 0.02;
  std::printf("voxels of %g cm, truncation 4 voxels, depth to 4 m\n", voxel * 100);
  std::printf(
      "| scene | distance | weight | mean error, voxels | 95 %%, voxels | surface within one voxel | vertices "
      "|\n|---|---|---|---|---|---|---|\n");
  measure(rendered_house(), voxel);
  for (const bool noisy : {false, true}) measure(simulated(noisy), voxel);
}
