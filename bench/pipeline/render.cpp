// Ray casting of 640 x 480 views inside a synthetic room of about 8000 blocks (bench/support/room.h).
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "bench/support/room.h"
#include "mapping/surface/render.h"

namespace {
using namespace felt;
using Eigen::Vector3d;
using felt::bench::room_distance;

const Map& room() {
  static const Map map = felt::bench::room_map();
  return map;
}

void render(benchmark::State& state) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(state.range(0)));
  const bool attributes = state.range(1) != 0;
  const RayCaster caster(room());
  const PinholeCamera camera{525, 525, 319.5, 239.5, 640, 480};
  int frame = 0;
  for (auto _ : state) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.linear() = (Eigen::AngleAxisd(0.3 * frame, Vector3d::UnitZ()) * Eigen::AngleAxisd(-1.8, Vector3d::UnitX()))
                     .toRotationMatrix();
    T.translation() = Vector3d(-1.2, 1.0, 0.4);
    ++frame;
    const RenderedView view = caster.render(camera, T, {.normals = attributes, .color = attributes});
    state.PauseTiming();
    for (int v = 0; v < 480; v += 7)
      for (int u = 0; u < 640; u += 7) {
        const Vector3d p = T * (camera.ray(u, v) * double(view.depth_m(u, v)));
        if (!(std::abs(room_distance(p)) < 0.005)) state.SkipWithError("the depth is not the room's");
      }
    state.ResumeTiming();
  }
  state.counters["frames_per_s"] = benchmark::Counter(double(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(render)
    ->ArgNames({"threads", "attributes"})
    ->Args({1, 0})
    ->Args({1, 1})
    ->Args({2, 1})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace

BENCHMARK_MAIN();
