// Depth fusion side by side: the same frames, voxels, truncation and threads. Engines take turns, a whole sequence
// each, three times round; the best of the three counts, frame by frame, so that changes of the machine's speed hit all
// alike. And the distance of the surface each gives to the exact mesh of the rendered house.
//   bench_peers speed [voxel_size_m] [threads] [frames]
//   bench_peers surface [voxel_size_m] [threads] [engine, from 0: all]
#include <tbb/global_control.h>

#include <cstring>
#include <numeric>

#include "bench/peers/engine.h"
#include "bench/support/bench.h"
#include "core/simd.h"
#include "io/meshes/mesh_io.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_library.h"
#include "mapping/evaluation/mesh_distance.h"

namespace {

using namespace felt;
using bench::Engine;
using bench::Settings;

std::vector<std::unique_ptr<Engine>> engines(const Settings& settings) {
  std::vector<std::unique_ptr<Engine>> all;
  for (int e = 0; e < bench::kEngines; ++e) all.push_back(bench::engine(e, settings));
  return all;
}

void speed(const Settings& settings, const std::vector<Frame>& frames) {
  constexpr int kRounds = 3;  // each from an empty map: the best of them counts, frame by frame
  std::vector<std::vector<double>> best;
  std::vector<std::string> names;
  for (int round = 0; round < kRounds; ++round) {
    auto all = engines(settings);
    for (auto& engine : all)
      for (const Frame& frame : frames) engine->prepare(frame);
    best.resize(all.size(), std::vector<double>(frames.size(), 1e9));
    names.clear();
    for (auto& engine : all) names.push_back(engine->name());
    for (size_t e = 0; e < all.size(); ++e)
      for (size_t n = 0; n < frames.size(); ++n)
        best[e][n] = std::min(best[e][n], bench::seconds([&] { all[e]->integrate(n); }));
  }
  const double ours = bench::median(best[0]);
  std::printf("| engine | median ms a frame | mean ms | times feltmap |\n|---|---|---|---|\n");
  for (size_t e = 0; e < best.size(); ++e)
    std::printf("| %s | %.3f | %.3f | %.1f |\n", names[e].c_str(), 1e3 * bench::median(best[e]),
                1e3 * std::accumulate(best[e].begin(), best[e].end(), 0.0) / double(frames.size()),
                bench::median(best[e]) / ours);
}

/// `only`: number of the one engine to measure, or -1. Meshers of Open3D 0.16 end the program on some of these maps (an
/// assertion that takes voxel 0 for none, a segmentation fault).
void surface_table(const char* scene, const Settings& settings, const std::vector<Frame>& frames, int only,
                   const std::function<std::vector<float>(const std::vector<Eigen::Vector3f>&)>& error_m) {
  auto all = engines(settings);
  for (int e = 0; e < int(all.size()); ++e) {
    if (only >= 0 && e != only) continue;
    for (const Frame& frame : frames) all[e]->prepare(frame);
    for (size_t n = 0; n < frames.size(); ++n) all[e]->integrate(n);
    const std::vector<Eigen::Vector3f> points = all[e]->surface();
    const std::vector<float> error = error_m(points);
    const double mean = std::accumulate(error.begin(), error.end(), 0.0) / double(error.size());
    std::printf("| %s | %s | %.4f | %.4f | %zu |\n", scene, all[e]->name().c_str(), mean / settings.voxel_size_m,
                bench::median({error.begin(), error.end()}) / settings.voxel_size_m, points.size());
    std::fflush(stdout);
  }
}

void surface(const Settings& settings, int only) {
  std::printf("| scene | engine | mean error, voxels | median, voxels | points |\n|---|---|---|---|---|\n");
  const TriangleTree truth(read_mesh(bench::recorded("house_living_rendered") / "gt_mesh.ply"));
  surface_table("rendered house, exact", settings, bench::decoded("house_living_rendered"), only,
                [&](const auto& points) { return distances_to_mesh(points, truth); });
  const Scene scene = make_scene("room1");
  RenderOptions options;
  options.with_color = false;
  const Trajectory path = standard_trajectory(scene, 60);
  const auto error_m = [&](const std::vector<Eigen::Vector3f>& points) {
    std::vector<float> error;
    for (const auto& p : points) error.push_back(std::abs(float(signed_distance_m(scene, p.cast<double>()))));
    return error;
  };
  surface_table("room1, exact", settings, render_sequence(scene, path, simulated_camera(), options), only, error_m);
  options.noise = DepthNoise{};
  surface_table("room1, sensor noise", settings, render_sequence(scene, path, simulated_camera(), options), only,
                error_m);
}

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  const bool only_surface = argc > 1 && std::strcmp(argv[1], "surface") == 0;
  Settings settings;
  if (argc > 2) settings.voxel_size_m = std::atof(argv[2]);
  settings.truncation_m = 4 * settings.voxel_size_m;
  const int threads = argc > 3 ? std::atoi(argv[3]) : 1;
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  bench::open3d_threads(threads);
  bench::opencv_threads(threads);
  std::printf("voxels of %g cm, truncation 4 voxels, depth to 4 m, %d thread(s), SIMD %s\n",
              settings.voxel_size_m * 100, threads, simd_name().c_str());
  if (only_surface) {
    surface(settings, argc > 4 ? std::atoi(argv[4]) : -1);
    return 0;
  }
  std::vector<Frame> frames = bench::decoded("7scenes_redkitchen");
  if (argc > 4) frames.resize(std::min(frames.size(), size_t(std::atoi(argv[4]))));
  speed(settings, frames);
}
