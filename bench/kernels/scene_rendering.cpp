// Rendering of simulated scenes: one 640x480 view of a furnished room on one thread, without and with colour.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_library.h"

namespace {

void view_of_a_room(benchmark::State& state) {
  const tbb::global_control one_thread(tbb::global_control::max_allowed_parallelism, 1);
  const felt::Scene scene = felt::make_scene("room" + std::to_string(state.range(0)));
  const felt::Trajectory trajectory = felt::standard_trajectory(scene, 12);
  const felt::PinholeCamera camera = felt::simulated_camera();
  size_t frame = 0;
  for (auto _ : state) {
    const felt::SceneView view = felt::render_view(scene, camera, trajectory[frame++ % 12], state.range(1) != 0);
    // A closed room: every ray ends somewhere.
    for (const float depth_m : view.depth_m)
      if (depth_m <= 0) return state.SkipWithError("a ray met nothing");
  }
}

}  // namespace

BENCHMARK(view_of_a_room)
    ->ArgsProduct({{1, 5}, {0, 1}})
    ->ArgNames({"room", "color"})
    ->Unit(benchmark::kMillisecond)
    ->Iterations(12)
    ->Repetitions(5)
    ->ReportAggregatesOnly();

BENCHMARK_MAIN();
