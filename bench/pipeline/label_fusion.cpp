// What classes cost over geometry alone in processor time: one thread, 2 cm, for hard labels and for the three most
// probable classes, by number of classes in the table; and the bytes they take. Labels are those of a recorded
// sequence, by default the rendered house. The maps that are timed are compared with what the scalar kernels make of
// the same frames.
//   bench_label_fusion [sequence]
#include <tbb/global_control.h>

#include <ctime>

#include <cmath>

#include "bench/support/bench.h"
#include "core/simd.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/labels/class_belief.h"

namespace {

using namespace felt;

constexpr double kVoxel = 0.02;

struct Run {
  double ms = 0;  // median over frames of the best of the repetitions
  Map map{kVoxel, 4 * kVoxel};
  uint64_t label_voxels = 0;
};

enum class Input { none, hard, soft };

/// Processor time of this thread: what else the machine does is left out.
double thread_seconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

struct Case {
  const char* name;
  Input input;
  int k;     // classes of the table
  int most;  // ids seen: the same classes in a larger table
  float max_evidence;
};

/// Ids 0 .. k - 1; 0 is a class like the others.
ClassTable table(int k) {
  std::vector<ClassInfo> classes;
  for (int i = 0; i < k; ++i)
    classes.push_back({.id = uint16_t(i), .name = "class " + std::to_string(i), .color = default_class_color(i)});
  return ClassTable(classes);
}

/// 0.8 for the label, 0.15 and 0.03 for two others, 0.02 for classes that are not named.
ProbabilityImage top3(const LabelImage& labels, int most) {
  ProbabilityImage p{labels.width(), labels.height(), 3, {}, {}};
  for (const uint16_t id : labels) {
    p.class_id.insert(p.class_id.end(), {id, uint16_t((id + 1) % most), uint16_t((id + 3) % most)});
    p.probability.insert(p.probability.end(), {0.8f, 0.15f, 0.03f});
  }
  return p;
}

std::vector<Frame> prepared(const std::vector<Frame>& recorded, const Case& c) {
  std::vector<Frame> frames = recorded;
  for (Frame& frame : frames) {
    for (uint16_t& id : frame.labels) id = uint16_t(id % c.most);
    if (c.input == Input::soft) frame.probabilities = top3(frame.labels, c.most);
    if (c.input != Input::hard) frame.labels = {};
  }
  return frames;
}

Run fuse_all(const std::vector<Frame>& frames, const Case& c, int repetitions) {
  IntegrationConfig config;
  config.labels.max_evidence = c.max_evidence;
  std::vector<double> best(frames.size(), 1e9);
  Run run;
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    Map map(kVoxel, 4 * kVoxel);
    if (c.input != Input::none) map.classes = table(c.k);
    IntegrationScratch scratch;
    run.label_voxels = 0;
    for (size_t n = 0; n < frames.size(); ++n) {
      const double start = thread_seconds();
      const FrameStats stats = integrate(map, frames[n], config, scratch);
      best[n] = std::min(best[n], thread_seconds() - start);
      run.label_voxels += stats.labels.voxels;
    }
    run.map = std::move(map);
  }
  run.ms = 1e3 * bench::median(best);
  return run;
}

double total(const Map& map) {
  double sum = 0;
  for (const Block& block : map.store.blocks())
    for (int i = 0; block.has_evidence() && i < kBlockVoxels; ++i) sum += double(total_evidence(block, i));
  return sum;
}

/// Ends the program where the map is not what the scalar kernels make of the same frames, or where evidence was lost.
void check(const std::vector<Frame>& frames, const Case& c, const Run& run) {
  choose_simd("scalar", "bench_label_fusion");
  const std::string expected = map_hash(fuse_all(frames, c, 1).map);
  choose_simd("", "bench_label_fusion");
  const bool same = map_hash(run.map) == expected;
  const double evidence = total(run.map), added = double(run.label_voxels);
  const bool conserved = c.max_evidence > 0 ? evidence <= added : std::abs(evidence - added) <= 1e-4 * added;
  if (same && conserved) return;
  std::printf("%s: WRONG: %s, evidence %.1f of %.1f added\n", c.name, same ? "map as scalar" : "map not as scalar",
              evidence, added);
  std::exit(1);
}

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  const std::vector<Frame> recorded =
      bench::decoded(argc > 1 ? argv[1] : "house_living_rendered", {.frames = {.step = 4}, .read_color = false});
  std::printf("%zu frames of %dx%d, SIMD %s, one thread, 2 cm\n", recorded.size(), recorded[0].depth_m.width(),
              recorded[0].depth_m.height(), simd_name().c_str());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  const Case cases[] = {{"geometry alone", Input::none, 0, 8, 0},
                        {"hard, k = 8", Input::hard, 8, 8, 0},
                        {"hard, k = 40", Input::hard, 40, 8, 0},
                        {"hard, k = 150", Input::hard, 150, 8, 0},
                        {"hard, k = 40, all its classes", Input::hard, 40, 40, 0},
                        {"hard, k = 40, all, capped", Input::hard, 40, 40, 10},
                        {"top-3, k = 8", Input::soft, 8, 8, 0},
                        {"top-3, k = 40", Input::soft, 40, 8, 0},
                        {"top-3, k = 150", Input::soft, 150, 8, 0},
                        {"top-3, k = 40, all, capped", Input::soft, 40, 40, 10}};
  std::printf(
      "| input | frame ms | against geometry | voxels labelled a frame | class bytes per active voxel |\n"
      "|---|---|---|---|---|\n");
  double geometry_ms = 0;
  for (const Case& c : cases) {
    const std::vector<Frame> frames = prepared(recorded, c);
    const Run run = fuse_all(frames, c, 5);
    if (c.input == Input::none) geometry_ms = run.ms;
    std::printf("| %s | %.3f | %.2f | %.0f | %.2f |\n", c.name, run.ms, run.ms / geometry_ms,
                double(run.label_voxels) / double(frames.size()),
                double(class_bytes(run.map)) / double(active_voxel_count(run.map)));
    std::fflush(stdout);
    if (c.input != Input::none) check(frames, c, run);
  }
}
