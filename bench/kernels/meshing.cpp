// Marching cubes on a synthetic room of about 8000 blocks (bench/support/room.h).
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>

#include "bench/support/room.h"
#include "io/files/system_memory.h"
#include "mapping/surface/marching_cubes.h"

namespace {
using namespace felt;
using felt::bench::room_distance;

const Map& room() {
  static const Map map = felt::bench::room_map();
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

int main(int argc, char** argv) {
  felt::keep_freed_memory();  // as the program does: pages of frames decoded before serve the mesh
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
}
