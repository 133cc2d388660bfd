// Marching cubes on a synthetic room of about 6000 blocks: 5 x 4 x 2.6 m seen from inside, a sphere in it, 2 cm voxels,
// 8 cm truncation, coloured. Reports nanoseconds per observed voxel.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "mapping/marching_cubes.h"

namespace {
using namespace felt;
using Eigen::Vector3d;

double room_distance(const Vector3d& p) {
  const double walls = (Vector3d(2.5, 2.0, 1.3) - p.cwiseAbs()).minCoeff();
  const double waves = 0.01 * std::sin(3 * p.x()) * std::cos(4 * p.y());
  return std::min(walls + waves, (p - Vector3d(0.4, 0.3, -0.2)).norm() - 0.6);
}

const Map& room() {
  static const Map map = [] {
    Map m(0.02, 0.08);
    for (int bx = -17; bx <= 16; ++bx)
      for (int by = -14; by <= 13; ++by)
        for (int bz = -10; bz <= 9; ++bz) {
          const Vector3d centre = (Vector3d(bx, by, bz) * 8 + Vector3d::Constant(3.5)) * 0.02;
          if (std::abs(room_distance(centre)) > 0.08 + 0.16 * 0.87) continue;
          GeometryPlanes planes;
          for (int i = 0; i < kBlockVoxels; ++i) {
            const Index3 v = voxel_of_offset(i);
            const double d = room_distance(Vector3d(bx * 8 + v.x, by * 8 + v.y, bz * 8 + v.z) * 0.02);
            planes.weight[i] = d > -0.08 ? 1.0f : 0.0f;
            planes.tsdf[i] = float(std::min(d, 0.08));
          }
          if (!planes.observed()) continue;
          Block& block = m.store[m.store.find_or_create({bx, by, bz})];
          *block.geometry = planes;
          ColorPlanes& color = m.store.add_color(block);
          std::fill_n(color.r, kBlockVoxels, uint16_t(200 * 256));
          std::fill_n(color.count, kBlockVoxels, uint16_t(3));
        }
    return m;
  }();
  return map;
}

void extract(benchmark::State& state) {
  const Map& map = room();
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(state.range(0)));
  const MeshOptions options{.normals = state.range(1) != 0, .colors = state.range(1) != 0};
  TriangleMesh mesh;
  for (auto _ : state) {
    mesh = extract_mesh(map, options);
    benchmark::DoNotOptimize(mesh.positions.data());
  }
  double worst = 0;
  for (const auto& p : mesh.positions) worst = std::max(worst, std::abs(room_distance(p.cast<double>())));
  if (mesh.triangles.size() < 100000 || worst > 0.01) state.SkipWithError("the mesh is not the room's");
  state.counters["blocks"] = double(map.store.size());
  state.counters["triangles"] = double(mesh.triangles.size());
  state.counters["s_per_voxel"] = benchmark::Counter(double(active_voxel_count(map)) * double(state.iterations()),
                                                     benchmark::Counter::kIsRate | benchmark::Counter::kInvert);
}
BENCHMARK(extract)
    ->ArgNames({"threads", "attributes"})
    ->Args({1, 0})
    ->Args({1, 1})
    ->Args({2, 1})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
