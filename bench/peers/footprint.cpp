// Memory and mesh time side by side: the same frames, voxels, truncation and threads; each engine in a process of its
// own, so that its memory is what its process grew by while it fused.
//   bench_peers_footprint [voxel_size_m] [threads] [sequence]
#include <malloc.h>
#include <sys/wait.h>
#include <tbb/global_control.h>
#include <unistd.h>

#include <fstream>

#include "bench/peers/engine.h"
#include "bench/support/bench.h"
#include "core/simd.h"
#include "mapping/marching_cubes.h"
#include "mapping/tsdf_integrator.h"

namespace {

using namespace felt;
using bench::Engine;
using bench::Settings;

class Feltmap final : public Engine {
public:
  explicit Feltmap(const Settings& s) : map_(s.voxel_size_m, s.truncation_m) {
    config_.max_depth_m = float(s.max_depth_m);
  }
  std::string name() const override { return "feltmap"; }
  void prepare(const Frame& frame) override {
    frames_.push_back(frame);
    frames_.back().color = {};
  }
  void integrate(size_t n) override { felt::integrate(map_, frames_[n], config_, scratch_); }
  std::vector<Eigen::Vector3f> surface() override {
    return extract_mesh(map_, {.normals = false, .colors = false}).positions;
  }

private:
  Map map_;
  IntegrationConfig config_;
  IntegrationScratch scratch_;
  std::vector<Frame> frames_;
};

std::unique_ptr<Engine> engine(int number, const Settings& settings) {
  switch (number) {
    case 0:
      return std::make_unique<Feltmap>(settings);
    case 1:
      return bench::open3d_voxel_block_grid(settings, 8);
    case 2:
      return bench::open3d_voxel_block_grid(settings, 16);
    case 3:
      return bench::open3d_scalable_volume(settings);
    default:
      return bench::opencv_hash_tsdf(settings);
  }
}
constexpr int kEngines = 5;

double resident_mb() {
  malloc_trim(0);
  std::ifstream statm("/proc/self/statm");
  double size = 0, resident = 0;
  statm >> size >> resident;
  return resident * double(sysconf(_SC_PAGESIZE)) * 1e-6;
}

struct Footprint {
  char name[64];
  double map_mb, mesh_ms, total_ms;
  size_t points;
};

Footprint measure(int number, const Settings& settings, int threads, const std::string& sequence) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  bench::open3d_threads(threads);
  bench::opencv_threads(threads);
  std::vector<Frame> frames = bench::decoded(sequence);
  const size_t count = frames.size();
  Footprint f{};
  {
    // Libraries load and pools start before anything is counted.
    const auto warm = engine(number, settings);
    warm->prepare(frames[0]);
    warm->integrate(0);
  }
  const auto engine_ = engine(number, settings);
  for (Frame& frame : frames) {
    engine_->prepare(frame);
    frame = {};
  }
  frames.clear();
  const double before = resident_mb();
  f.total_ms = 1e3 * bench::seconds([&] {
                 for (size_t n = 0; n < count; ++n) engine_->integrate(n);
               });
  f.map_mb = resident_mb() - before;
  f.mesh_ms = 1e9;
  for (int round = 0; round < 3; ++round)
    f.mesh_ms = std::min(f.mesh_ms, 1e3 * bench::seconds([&] { f.points = engine_->surface().size(); }));
  std::snprintf(f.name, sizeof f.name, "%s", engine_->name().c_str());
  return f;
}

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  Settings settings;
  if (argc > 1) settings.voxel_size_m = std::atof(argv[1]);
  settings.truncation_m = 4 * settings.voxel_size_m;
  const int threads = argc > 2 ? std::atoi(argv[2]) : 1;
  const std::string sequence = argc > 3 ? argv[3] : "house_living_rendered";
  bench::recorded(sequence);
  std::printf("%s, voxels of %g cm, truncation 4 voxels, depth to 4 m, %d thread(s), SIMD %s\n\n", sequence.c_str(),
              settings.voxel_size_m * 100, threads, simd_name().c_str());
  std::printf(
      "| engine | memory of the map, MB | times feltmap | mesh or points, ms | times feltmap | vertices |\n"
      "|---|---|---|---|---|---|\n");
  std::fflush(stdout);
  Footprint ours{};
  for (int e = 0; e < kEngines; ++e) {
    int ends[2];
    if (pipe(ends) != 0) return 1;
    const pid_t child = fork();
    if (child == 0) {
      const Footprint f = measure(e, settings, threads, sequence);
      const bool sent = write(ends[1], &f, sizeof f) == ssize_t(sizeof f);
      _exit(sent ? 0 : 1);
    }
    close(ends[1]);
    Footprint f{};
    const bool received = read(ends[0], &f, sizeof f) == ssize_t(sizeof f);
    close(ends[0]);
    int status = 0;
    waitpid(child, &status, 0);
    if (!received || status != 0) {
      std::printf("| engine %d | failed | | | | |\n", e);
      continue;
    }
    if (e == 0) ours = f;
    std::printf("| %s | %.1f | %.2f | %.0f | %.2f | %zu |\n", f.name, f.map_mb, f.map_mb / ours.map_mb, f.mesh_ms,
                f.mesh_ms / ours.mesh_ms, f.points);
    std::fflush(stdout);
  }
}
