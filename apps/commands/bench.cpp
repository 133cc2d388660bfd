#include <tbb/global_control.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "core/error.h"
#include "core/median.h"
#include "core/simd.h"
#include "core/stopwatch.h"
#include "io/sequence/open_sequence.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/surface/marching_cubes.h"

namespace felt::apps {
namespace {
using Json = nlohmann::ordered_json;

struct BenchOptions : CommonOptions {
  std::string sequence;
  std::vector<double> voxel_sizes_m = {0.01, 0.02, 0.05};
  int64_t frames = 100;
  int repetitions = 3;
};

/// Usable frames from the start of a sequence, and what decoding one took.
struct DecodedFrames {
  std::vector<Frame> frames;
  std::vector<double> decode_ms;
};

DecodedFrames decode(const SequenceReader& sequence, int64_t most) {
  DecodedFrames decoded;
  for (int64_t i = 0; i < std::min(sequence.size(), most); ++i) {
    const Stopwatch watch;
    ReadResult result = sequence.read(i);
    if (Frame* frame = std::get_if<Frame>(&result)) {
      decoded.decode_ms.push_back(1e3 * watch.seconds());
      decoded.frames.push_back(std::move(*frame));
    }
  }
  return decoded;
}

/// The frames fused into a new map `repetitions` times: per frame the best, of these the median.
Json fusion_cost(const DecodedFrames& decoded, const ClassTable& classes, double voxel_size_m, int threads,
                 int repetitions) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
  std::vector<double> frame_ms(decoded.frames.size(), 1e300);
  Json row = {{"voxel_size_m", voxel_size_m}, {"threads", threads}};
  for (int repetition = 0; repetition < repetitions; ++repetition) {
    Map map(voxel_size_m, 4 * voxel_size_m);
    map.classes = classes;
    IntegrationScratch scratch;
    for (size_t n = 0; n < decoded.frames.size(); ++n) {
      const FrameStats stats = integrate(map, decoded.frames[n], {}, scratch);
      frame_ms[n] = std::min(frame_ms[n], 1e3 * (stats.allocate_s + stats.fuse_s));
    }
    if (repetition + 1 < repetitions) continue;
    row["fuse_ms"] = median(frame_ms);
    const Stopwatch watch;
    const size_t triangles = extract_mesh(map).triangles.size();
    row["mesh_ms"] = 1e3 * watch.seconds();
    row["triangles"] = triangles;
    row["blocks"] = map.store.size();
    row["bytes"] = map.store.geometry_bytes() + map.store.color_bytes() + map.store.plane_bytes();
  }
  return row;
}

int run(const BenchOptions& o) {
  const auto sequence = open_sequence(o.sequence, {});
  const DecodedFrames decoded = decode(*sequence, o.frames);
  if (decoded.frames.empty())
    throw FormatError(describe_mismatch(o.sequence, "frames", "at least one that can be fused", "none"));

  Json report = {{"sequence", o.sequence},
                 {"frames", decoded.frames.size()},
                 {"width", decoded.frames[0].depth_m.width()},
                 {"height", decoded.frames[0].depth_m.height()},
                 {"simd", simd_name()},
                 {"decode_ms", median(decoded.decode_ms)},
                 {"fusion", Json::array()}};
  std::vector<int> thread_counts = {1};
  if (o.thread_count() > 1) thread_counts.push_back(o.thread_count());
  const bool print = !o.json && !o.quiet;
  if (print)
    std::printf(
        "%zu frames of %dx%d, SIMD %s, decoding %.2f ms a frame on one thread\n"
        "voxel     threads   fuse ms   mesh ms   blocks      MB\n",
        decoded.frames.size(), decoded.frames[0].depth_m.width(), decoded.frames[0].depth_m.height(),
        simd_name().c_str(), median(decoded.decode_ms));
  for (const double size : o.voxel_sizes_m)
    for (const int threads : thread_counts) {
      const Json row = fusion_cost(decoded, sequence->info().classes, size, threads, o.repetitions);
      if (print)
        std::printf("%-9g %-9d %-9.3f %-9.1f %-11zu %.1f\n", size, threads, row["fuse_ms"].get<double>(),
                    row["mesh_ms"].get<double>(), row["blocks"].get<size_t>(), row["bytes"].get<double>() * 1e-6);
      report["fusion"].push_back(row);
    }
  if (o.json) print_json(report);
  return kDone;
}

}  // namespace

void add_bench(CLI::App& app) {
  auto options = std::make_shared<BenchOptions>();
  CLI::App& command = add_command(
      app,
      {"bench", "Time decoding, fusion and meshing of a sequence on this machine, by voxel size and threads",
       "feltmap bench recording\n"
       "feltmap bench recording --voxel-sizes 0.01 0.02 --max-frames 50 --json"},
      *options, [options] { return run(*options); });
  command.add_option("SEQUENCE", options->sequence, "Folder of a recorded RGB-D sequence, or a .sens file")->required();
  command.add_option("--voxel-sizes", options->voxel_sizes_m, "Edges of a voxel, metres")
      ->check(above_zero_up_to(100))
      ->capture_default_str();
  command.add_option("--max-frames", options->frames, "Frames that are decoded and held in memory")
      ->check(above_zero())
      ->capture_default_str();
  command.add_option("--repetitions", options->repetitions, "Times that each setting runs; the best of a frame counts")
      ->check(above_zero())
      ->capture_default_str();
}

}  // namespace felt::apps
