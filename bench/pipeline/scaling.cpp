// How the cost of a frame and the size of the map grow with voxel size, resolution, number of frames, number of classes
// and threads: tables, and one picture of the curves. Voxels are those of the blocks in view (cost) and of the blocks
// of the map (bytes).
//   bench_scaling [picture.svg]
#include <tbb/global_control.h>

#include <map>

#include "bench/support/bench.h"
#include "core/simd.h"
#include "io/pictures/plot_svg.h"
#include "io/simulation/render_sequence.h"
#include "io/simulation/scene_library.h"
#include "mapping/fusion/tsdf_integrator.h"

namespace {

using namespace felt;

struct Cost {
  double ms = 0;            ///< of a frame: median over frames of the best of the rounds
  double ns_per_voxel = 0;  ///< likewise
  double megabytes = 0;     ///< of the map
  double bytes_per_voxel = 0;
};

Cost fuse(const std::vector<Frame>& frames, double voxel_m, size_t threads, const ClassTable& classes = {}) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  constexpr int kRounds = 3;
  std::vector<double> best(frames.size(), 1e9), per_voxel(frames.size());
  Cost cost;
  for (int round = 0; round < kRounds; ++round) {
    Map map(voxel_m, 4 * voxel_m);
    map.classes = classes;
    IntegrationScratch scratch;
    for (size_t n = 0; n < frames.size(); ++n) {
      const FrameStats stats = integrate(map, frames[n], {}, scratch);
      best[n] = std::min(best[n], stats.allocate_s + stats.fuse_s);
      per_voxel[n] = best[n] / double(std::max<size_t>(1, stats.blocks_in_view) * kBlockVoxels);
    }
    const auto bytes = double(map.store.geometry_bytes() + map.store.plane_bytes());
    cost.megabytes = 1e-6 * bytes;
    cost.bytes_per_voxel = bytes / double(map.store.size() * kBlockVoxels);
  }
  cost.ms = 1e3 * bench::median(best);
  cost.ns_per_voxel = 1e9 * bench::median(per_voxel);
  return cost;
}

/// Furnished room 1, exact depth, without colour and labels.
std::vector<Frame> room(int frames, int width, int height) {
  const Scene scene = make_scene("room1");
  RenderOptions options;
  options.with_color = false;
  std::vector<Frame> all =
      render_sequence(scene, standard_trajectory(scene, frames), simulated_camera(width, height), options);
  for (Frame& frame : all) frame.color = {};
  return all;
}

std::vector<Frame> without_labels(std::vector<Frame> frames) {
  for (Frame& frame : frames) frame.labels = {};
  return frames;
}

ClassTable table_of(int k) {
  std::vector<ClassInfo> rows;
  for (int i = 0; i < k; ++i) rows.push_back({uint16_t(i + 1), "class " + std::to_string(i + 1), {}, false});
  return ClassTable(rows);
}

/// Things as classes: instance i is class i mod k.
std::vector<Frame> labelled(std::vector<Frame> frames, int k, int top) {
  for (Frame& frame : frames) {
    for (size_t i = 0; i < frame.labels.size(); ++i)
      frame.labels.data()[i] = uint16_t(frame.instances.data()[i] % k + 1);
    if (top == 0) continue;
    frame.probabilities = {frame.labels.width(), frame.labels.height(), top, {}, {}};
    for (const uint16_t id : frame.labels)
      for (int r = 0; r < top; ++r) {
        frame.probabilities.class_id.push_back(uint16_t((id - 1 + r) % k + 1));
        frame.probabilities.probability.push_back(r == 0 ? 0.8f : 0.2f / float(top - 1));
      }
  }
  return frames;
}

/// One table and its panel.
struct Curve {
  Plot plot;
  const char* x_name;

  Curve(const char* title, const char* x_label, const char* y_label, bool log) : plot{title, x_label, y_label, {}, {}} {
    plot.log_x = plot.log_y = log;
    x_name = x_label;
  }
  void add(const std::string& series, double x, double y) {
    for (PlotSeries& s : plot.series)
      if (s.name == series) {
        s.x.push_back(x), s.y.push_back(y);
        return;
      }
    plot.series.push_back({series, {x}, {y}, int(plot.series.size())});
  }
};

}  // namespace

int main(int argc, char** argv) {
  apply_simd_choice();
  const std::vector<Frame> frames = room(30, 640, 480), plain = without_labels(frames);
  std::printf("furnished room 1, exact depth, 30 frames of 640x480 unless told otherwise, depth only, SIMD %s\n",
              simd_name().c_str());
  std::vector<Plot> plots;

  std::printf(
      "\n| voxel, cm | threads | ms a frame | ns a voxel | map, MB | bytes a voxel |\n|---|---|---|---|---|---|\n");
  Curve by_voxel("Voxel size", "voxel, cm", "ms a frame", true);
  for (const double cm : {5.0, 3.0, 2.0, 1.5, 1.0})
    for (const size_t threads : {1, 2}) {
      const Cost c = fuse(plain, cm / 100, threads);
      std::printf("| %g | %zu | %.3f | %.2f | %.1f | %.2f |\n", cm, threads, c.ms, c.ns_per_voxel, c.megabytes,
                  c.bytes_per_voxel);
      by_voxel.add(threads == 1 ? "1 thread" : "2 threads", cm, c.ms);
    }
  plots.push_back(by_voxel.plot);

  std::printf("\n| image, 2 cm voxels | ms a frame | ns a voxel | ns a pixel |\n|---|---|---|---|\n");
  Curve by_pixels("Resolution", "pixels", "ms a frame", true);
  for (const int width : {160, 320, 640, 1280}) {
    const Cost c = fuse(without_labels(room(width > 640 ? 8 : 15, width, width * 3 / 4)), 0.02, 1);
    std::printf("| %dx%d | %.3f | %.2f | %.2f |\n", width, width * 3 / 4, c.ms, c.ns_per_voxel,
                1e6 * c.ms / (width * width * 0.75));
    by_pixels.add("1 thread", width * width * 0.75, c.ms);
  }
  plots.push_back(by_pixels.plot);

  std::printf(
      "\n| frames of the same path, 2 cm voxels | ms a frame | ns a voxel | map, MB | bytes a voxel "
      "|\n|---|---|---|---|---|\n");
  Curve by_frames("Frames", "frames", "ms a frame, map MB", true);
  for (const int n : {10, 20, 40, 80, 160}) {
    const Cost c = fuse(without_labels(room(n, 320, 240)), 0.02, 1);
    std::printf("| %d of 320x240 | %.3f | %.2f | %.1f | %.2f |\n", n, c.ms, c.ns_per_voxel, c.megabytes,
                c.bytes_per_voxel);
    by_frames.add("ms a frame", n, c.ms);
    by_frames.add("map, MB", n, c.megabytes);
  }
  plots.push_back(by_frames.plot);

  std::printf(
      "\n| classes, 2 cm voxels | evidence | ms a frame | ns a voxel | map, MB | bytes a voxel |\n"
      "|---|---|---|---|---|---|\n");
  Curve by_classes("Classes", "classes", "ms a frame", true);
  const auto class_row = [](int k, const char* evidence, const Cost& c) {
    std::printf("| %d | %s | %.3f | %.2f | %.1f | %.2f |\n", k, evidence, c.ms, c.ns_per_voxel, c.megabytes,
                c.bytes_per_voxel);
    std::fflush(stdout);
  };
  class_row(0, "-", fuse(plain, 0.02, 1));
  for (const int k : {3, 8, 40, 150}) {
    const Cost hard = fuse(labelled(frames, k, 0), 0.02, 1, table_of(k));
    class_row(k, "labels", hard);
    const Cost soft = fuse(labelled(frames, k, 3), 0.02, 1, table_of(k));
    class_row(k, "top 3 probabilities", soft);
    by_classes.add("labels", k, hard.ms);
    by_classes.add("top 3 probabilities", k, soft.ms);
  }
  plots.push_back(by_classes.plot);

  if (argc > 1) write_plot_svg(argv[1], plots, 2);
}
