// Cost of fusing one frame, frames decoded beforehand: by voxel size and number of threads, with the machine's own
// bound (memory bandwidth and scattered reads of depth) measured in the same run.
//   bench_fusion [sequence]
#include <tbb/global_control.h>

#include "bench/support/bench.h"
#include "bench/support/bound.h"
#include "core/simd.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/grids/vdb_state.h"

namespace {

using namespace felt;

struct Cost {
  double allocate_ms = 0, fuse_ms = 0, total_ms = 0;  // medians over frames of the best of the repetitions
  double first_third_ms = 0, last_third_ms = 0;       // does cost grow with the map?
  double blocks_per_frame = 0, voxels_per_frame = 0;
  size_t blocks = 0;
  double bytes_per_voxel = 0;
  double stock_bytes_per_voxel = 0;  // of the same values as live OpenVDB grids
};

Cost fuse_all(const std::vector<Frame>& frames, double voxel_size_m, size_t threads) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  std::vector<double> total(frames.size(), 1e9), allocate(frames.size(), 1e9), fuse(frames.size(), 1e9);
  Cost cost;
  constexpr int kRepetitions = 5;
  for (int repetition = 0; repetition < kRepetitions; ++repetition) {
    Map map(voxel_size_m, 4 * voxel_size_m);
    IntegrationScratch scratch;
    size_t blocks = 0;
    for (size_t n = 0; n < frames.size(); ++n) {
      const FrameStats stats = integrate(map, frames[n], {}, scratch);
      total[n] = std::min(total[n], stats.allocate_s + stats.fuse_s);
      allocate[n] = std::min(allocate[n], stats.allocate_s);
      fuse[n] = std::min(fuse[n], stats.fuse_s);
      blocks += stats.blocks_in_view;
    }
    cost.blocks_per_frame = double(blocks) / double(frames.size());
    cost.blocks = map.store.size();
    if (repetition == 0) {
      const BlockList observed = block_lists(map).observed;
      cost.stock_bytes_per_voxel = double(stock_grid(tsdf_grid(map, observed))->memUsage() +
                                          stock_grid(weight_grid(map, observed))->memUsage()) /
                                   double(observed.blocks->size() * kBlockVoxels);
    }
    cost.bytes_per_voxel = double(map.store.geometry_bytes()) / double(map.store.size() * kBlockVoxels);
  }
  const auto ms = [](std::vector<double> s) { return 1e3 * bench::median(std::move(s)); };
  const long third = long(frames.size() / 3);
  cost.total_ms = ms(total), cost.allocate_ms = ms(allocate), cost.fuse_ms = ms(fuse);
  cost.first_third_ms = ms({total.begin(), total.begin() + third});
  cost.last_third_ms = ms({total.end() - third, total.end()});
  return cost;
}

/// What the choice of distance costs: one thread, 2 cm, depth only, models in turn within every repetition.
void compare_distances(const std::vector<Frame>& frames) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  const char* const names[] = {"optical axis", "ray", "tangent plane"};
  std::vector<double> best[3];
  for (auto& times : best) times.assign(frames.size(), 1e9);
  constexpr int kRepetitions = 7;
  for (int repetition = 0; repetition < kRepetitions; ++repetition)
    for (int model = 0; model < 3; ++model) {
      Map map(0.02, 0.08);
      IntegrationScratch scratch;
      IntegrationConfig config;
      config.distance = DistanceModel(model);
      for (size_t n = 0; n < frames.size(); ++n) {
        const FrameStats stats = integrate(map, frames[n], config, scratch);
        best[model][n] = std::min(best[model][n], stats.allocate_s + stats.fuse_s);
      }
    }
  std::printf("| distance, 2 cm, one thread, depth only | frame ms | times the optical axis |\n|---|---|---|\n");
  const double axis = bench::median(best[0]);
  for (int model = 0; model < 3; ++model)
    std::printf("| %s | %.3f | %.3f |\n", names[model], 1e3 * bench::median(best[model]),
                bench::median(best[model]) / axis);
}

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  std::vector<Frame> colored = bench::decoded(argc > 1 ? argv[1] : "7scenes_redkitchen");
  std::vector<Frame> frames = colored;
  for (Frame& frame : frames) frame.color = {};
  std::printf("%zu frames of %dx%d, SIMD %s, weights constant, default distance, depth to 4 m\n", frames.size(),
              frames[0].depth_m.width(), frames[0].depth_m.height(), simd_name().c_str());
  std::printf(
      "| voxel | threads | colour | allocate ms | fuse ms | frame ms | first third | last third | blocks a frame | "
      "ns/voxel | map blocks | bytes/voxel | as two FloatGrids |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  double blocks_at_2cm = 0, one_thread = 0, two_threads = 0;
  for (const double voxel : {0.01, 0.02, 0.05})
    for (const size_t threads : {1, 2})
      for (const bool color : {false, true}) {
        const Cost c = fuse_all(color ? colored : frames, voxel, threads);
        if (voxel == 0.02 && !color)
          (threads == 1 ? one_thread : two_threads) = c.total_ms, blocks_at_2cm = c.blocks_per_frame;
        std::printf("| %g cm | %zu | %s | %.3f | %.3f | **%.3f** | %.3f | %.3f | %.0f | %.2f | %zu | %.2f | %.2f |\n",
                    voxel * 100, threads, color ? "yes" : "no", c.allocate_ms, c.fuse_ms, c.total_ms, c.first_third_ms,
                    c.last_third_ms, c.blocks_per_frame, c.total_ms * 1e6 / (c.blocks_per_frame * kBlockVoxels),
                    c.blocks, c.bytes_per_voxel, c.stock_bytes_per_voxel);
      }
  const DepthImage& depth = frames[frames.size() / 2].depth_m;
  const bench::MachineLimits limits = bench::machine_limits(depth);
  std::printf("bound: %.1f GB/s copied, %.2f G scattered reads/s\n", limits.copied_bytes_per_s * 1e-9,
              limits.scattered_reads_per_s * 1e-9);
  const double bound = bench::bound_ms(limits, depth, blocks_at_2cm);
  std::printf("2 cm, depth only: %.3f ms a frame, bound %.3f ms: %.1f times the bound; two threads %.2f times one\n",
              one_thread, bound, one_thread / bound, one_thread / two_threads);
  compare_distances(frames);
}
