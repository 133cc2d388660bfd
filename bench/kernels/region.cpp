// Region query on a flat floor, a rippled and a noisy one, against OpenVDB's own segmentation of the same voxels.
#include <benchmark/benchmark.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <tbb/global_control.h>
#include <vector>

#include <cmath>
#include <random>

#include "mapping/regions/region_query.h"
#include "mapping/regions/region_surface.h"

namespace {
using namespace felt;

/// A square of side x side voxels in xy with its surface near z = 3.3 voxels; one class. Ripples and noise, in voxels,
/// keep blocks from being flat.
Map square(int side, double ripple, double noise) {
  Map map(0.02, 0.08);
  map.classes = ClassTable({{1, "floor", {}, false}});
  std::mt19937 rng(1);
  std::normal_distribution<double> normal;
  for (int x = 0; x < side; ++x)
    for (int y = 0; y < side; ++y)
      for (int z = -4; z < 12; ++z) {
        const double d = z - 3.3 - ripple * std::sin(x * 0.2) * std::sin(y * 0.17) + noise * normal(rng);
        if (std::abs(d) > 4) continue;
        Block& block = map.store[map.store.find_or_create(block_of_voxel({x, y, z}))];
        const int i = offset_in_block({x, y, z});
        block.geometry->tsdf[i] = float(d * map.voxel_size_m);
        block.geometry->weight[i] = 5;
        if (block.evidence.empty()) block.evidence.push_back({0, map.store.new_plane()});
        if (std::abs(d) < 1.5) block.evidence[0].counts->value[i] = 4;
      }
  return map;
}

enum Surface { flat, rippled, noisy };

Map surface(int kind, int side) {
  return kind == flat ? square(side, 0, 0) : kind == rippled ? square(side, 1.5, 0) : square(side, 1.5, 0.05);
}

void report(benchmark::State& state, size_t voxels) {
  state.counters["voxels"] = double(voxels);
  state.counters["voxels/s"] =
      benchmark::Counter(double(voxels) * double(state.iterations()), benchmark::Counter::kIsRate);
}

void query(benchmark::State& state, int threads) {
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, size_t(threads));
  const Map map = surface(int(state.range(0)), int(state.range(1)));
  const RegionSettings settings;
  const Eigen::Vector3d point(1, 1, 3.3 * 0.02);
  size_t voxels = 0;
  for (auto _ : state) voxels = find_region(map, find_contact(map, point, settings), settings).voxels();
  if (voxels < size_t(state.range(1) * state.range(1))) state.SkipWithError("the region is not the whole surface");
  report(state, voxels);
}
void region_one_thread(benchmark::State& state) { query(state, 1); }
void region_all_threads(benchmark::State& state) { query(state, 64); }

/// Candidates as an active mask, which is what OpenVDB segments; building it is not timed.
openvdb::MaskGrid::Ptr candidate_grid(const Map& map) {
  auto grid = openvdb::MaskGrid::create();
  SurfaceRule rule;
  rule.band_m = float(map.voxel_size_m);
  rule.slot = 0;
  rule.class_ratio = 0.5f;
  for (const Block& block : map.store.blocks()) {
    const Index3 f = first_voxel(block.coord);
    for_each_bit(candidates(block, rule), [&](int i) {
      const Index3 v = voxel_of_offset(i);
      grid->tree().setValueOn({f.x + v.x, f.y + v.y, f.z + v.z});
    });
  }
  return grid;
}

void openvdb_segment_active_voxels(benchmark::State& state) {
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, 1);
  const auto grid = candidate_grid(surface(int(state.range(0)), int(state.range(1))));
  size_t voxels = 0;
  for (auto _ : state) {
    std::vector<openvdb::MaskGrid::Ptr> segments;
    openvdb::tools::segmentActiveVoxels(*grid, segments);
    voxels = segments.front()->activeVoxelCount();
  }
  report(state, voxels);
}

void openvdb_extract_segment_masks(benchmark::State& state) {
  const tbb::global_control control(tbb::global_control::max_allowed_parallelism, 1);
  const auto grid = candidate_grid(surface(int(state.range(0)), int(state.range(1))));
  size_t voxels = 0;
  for (auto _ : state) {
    std::vector<openvdb::BoolGrid::Ptr> masks;
    openvdb::tools::extractActiveVoxelSegmentMasks(*grid, masks);
    voxels = masks.front()->activeVoxelCount();
  }
  report(state, voxels);
}

void sizes(benchmark::internal::Benchmark* b) {
  for (const int kind : {flat, rippled, noisy})
    for (const int side : {110, 220, 440}) b->Args({kind, side});
  b->Unit(benchmark::kMillisecond);
}
BENCHMARK(region_one_thread)->Apply(sizes);
BENCHMARK(region_all_threads)->Apply(sizes);
BENCHMARK(openvdb_segment_active_voxels)->Args({rippled, 220})->Unit(benchmark::kMillisecond);
BENCHMARK(openvdb_extract_segment_masks)->Args({rippled, 220})->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
