// One table of everything that is compared: time of a frame, memory, mesh time and surface error of each engine on the
// rendered house, whose surface is known exactly, with the machine's bound. Same frames, voxels, truncation and
// threads. Each engine runs in processes of its own, so that its memory is what its process grew by, and one whose
// mesher ends the program still has its other figures. Engines take turns, twice round; the best counts, frame by
// frame.
//   bench_peers_table [voxel_size_m] [threads]
#include <malloc.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <fstream>
#include <numeric>

#include "bench/peers/engine.h"
#include "bench/support/bench.h"
#include "bench/support/bound.h"
#include "core/simd.h"
#include "io/meshes/mesh_io.h"
#include "mapping/evaluation/mesh_distance.h"

namespace {

using namespace felt;
using bench::Engine;
using bench::kEngines;
using bench::Settings;

constexpr const char* kSequence = "house_living_rendered";
constexpr int kRounds = 2;

double resident_bytes() {
  malloc_trim(0);
  std::ifstream statm("/proc/self/statm");
  double size = 0, resident = 0;
  statm >> size >> resident;
  return resident * double(sysconf(_SC_PAGESIZE));
}

/// What a process tells before it meshes, and after. Figures that are missing are not a number.
struct Fused {
  char name[64];
  size_t frames;  // whose times follow, milliseconds each
  double map_bytes, grown_bytes, bound_ms, copied_bytes_per_s, scattered_reads_per_s;
};
struct Meshed {
  double mesh_ms, error_voxels;
  size_t points;
};

template <typename T>
bool put(int end, const T& value) {
  return write(end, &value, sizeof value) == ssize_t(sizeof value);
}
template <typename T>
bool get(int end, T& value) {
  return read(end, &value, sizeof value) == ssize_t(sizeof value);
}

/// Runs in a process of its own.
bool measure(int number, const Settings& settings, int threads, int end) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  bench::open3d_threads(threads);
  bench::opencv_threads(threads);
  const std::vector<Frame> frames = bench::decoded(kSequence);
  const DepthImage depth = frames[frames.size() / 2].depth_m;
  const size_t count = frames.size();
  std::vector<double> ms(count, 1e9);
  double grown = 0;
  std::unique_ptr<Engine> engine;
  // What the process grows by is taken from the first pass; times are the best of both, frame by frame, as memory that
  // the process has never touched comes slowly, and not every engine takes it while it fuses.
  for (int pass = 0; pass < 2; ++pass) {
    {
      // Libraries load and pools start before anything is counted.
      const auto warm = bench::engine(number, settings);
      warm->prepare(frames[0]);
      warm->integrate(0);
    }
    engine.reset();
    engine = bench::engine(number, settings);
    for (const Frame& frame : frames) engine->prepare(frame);
    const double before = pass == 0 ? resident_bytes() : 0;
    for (size_t n = 0; n < count; ++n) ms[n] = std::min(ms[n], 1e3 * bench::seconds([&] { engine->integrate(n); }));
    if (pass == 0) grown = resident_bytes() - before;
  }
  Fused fused{{}, count, engine->map_bytes().value_or(NAN), grown, NAN, NAN, NAN};
  std::snprintf(fused.name, sizeof fused.name, "%s", engine->name().c_str());
  if (engine->blocks_per_frame() > 0) {
    const bench::MachineLimits limits = bench::machine_limits(depth);
    fused.bound_ms = bench::bound_ms(limits, depth, engine->blocks_per_frame());
    fused.copied_bytes_per_s = limits.copied_bytes_per_s;
    fused.scattered_reads_per_s = limits.scattered_reads_per_s;
  }
  if (!put(end, fused)) return false;
  for (const double t : ms)
    if (!put(end, t)) return false;
  std::vector<Eigen::Vector3f> points;
  Meshed meshed{};
  meshed.mesh_ms = 1e9;
  for (int round = 0; round < 2; ++round)
    meshed.mesh_ms = std::min(meshed.mesh_ms, 1e3 * bench::seconds([&] { points = engine->surface(); }));
  const TriangleTree truth(read_mesh(bench::recorded(kSequence) / "gt_mesh.ply"));
  const std::vector<float> error = distances_to_mesh(points, truth);
  meshed.points = points.size();
  meshed.error_voxels = std::accumulate(error.begin(), error.end(), 0.0) / double(error.size()) / settings.voxel_size_m;
  return put(end, meshed);
}

/// The best of the rounds so far; `meshes`: whether a mesh came out.
struct Figures {
  Fused fused{};
  Meshed meshed{};
  std::vector<double> ms;  // by frame
  bool fuses = false, meshes = false;
  double frame_ms() const { return bench::median(ms); }
};

void run(int number, const Settings& settings, int threads, Figures& best) {
  int ends[2];
  if (pipe(ends) != 0) return;
  const pid_t child = fork();
  if (child == 0) _exit(measure(number, settings, threads, ends[1]) ? 0 : 1);
  close(ends[1]);
  Fused fused{};
  Meshed meshed{};
  if (get(ends[0], fused)) {
    best.ms.resize(fused.frames, 1e9);
    for (double& known : best.ms) {
      double ms = 1e9;
      get(ends[0], ms);
      known = std::min(known, ms);
    }
    best.fused = fused, best.fuses = true;
    if (get(ends[0], meshed)) {
      if (best.meshes) meshed.mesh_ms = std::min(meshed.mesh_ms, best.meshed.mesh_ms);
      best.meshed = meshed, best.meshes = true;
    }
  }
  close(ends[0]);
  int status = 0;
  waitpid(child, &status, 0);
}

std::string cell(double value, const char* format) {
  if (!std::isfinite(value)) return "not told";
  char text[32];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  Settings settings;
  if (argc > 1) settings.voxel_size_m = std::atof(argv[1]);
  settings.truncation_m = 4 * settings.voxel_size_m;
  const int threads = argc > 2 ? std::atoi(argv[2]) : 1;
  bench::recorded(kSequence);
  std::array<Figures, kEngines> engines;
  for (int round = 0; round < kRounds; ++round)
    for (int e = 0; e < kEngines; ++e) run(e, settings, threads, engines[size_t(e)]);
  const Figures& ours = engines[0];
  if (!ours.meshes) {
    std::fprintf(stderr, "bench_peers_table: feltmap itself did not finish\n");
    return 1;
  }
  std::printf("%s, voxels of %g cm, truncation 4 voxels, depth to 4 m, %d thread(s), SIMD %s\n\n", kSequence,
              settings.voxel_size_m * 100, threads, simd_name().c_str());
  std::printf(
      "| engine | frame, ms | times feltmap | distances and weights, MB | times feltmap | process grew by, MB | mesh "
      "or "
      "points, ms | times feltmap | mean surface error, voxels | points "
      "|\n|---|---|---|---|---|---|---|---|---|---|\n");
  for (int e = 0; e < kEngines; ++e) {
    const Figures& f = engines[size_t(e)];
    if (!f.fuses) {
      std::printf("| engine %d | ended the program | | | | | | | | |\n", e);
      continue;
    }
    const double map = f.fused.map_bytes;
    std::printf("| %s | %.3f | %.1f | %s | %s | %.1f |", f.fused.name, f.frame_ms(), f.frame_ms() / ours.frame_ms(),
                cell(map * 1e-6, "%.1f").c_str(), cell(map / ours.fused.map_bytes, "%.2f").c_str(),
                f.fused.grown_bytes * 1e-6);
    if (f.meshes)
      std::printf(" %.0f | %.1f | %.4f | %zu |\n", f.meshed.mesh_ms, f.meshed.mesh_ms / ours.meshed.mesh_ms,
                  f.meshed.error_voxels, f.meshed.points);
    else
      std::printf(" ends the program | | | |\n");
  }
  if (threads == 1)
    std::printf(
        "\nThe machine's bound for a frame, one thread: %.3f ms (%.1f GB/s copied, %.2f G scattered reads/s); feltmap "
        "%.1f times that.\n",
        ours.fused.bound_ms, ours.fused.copied_bytes_per_s * 1e-9, ours.fused.scattered_reads_per_s * 1e-9,
        ours.frame_ms() / ours.fused.bound_ms);
}
