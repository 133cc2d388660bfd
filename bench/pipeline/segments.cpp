// Class-agnostic segments of recorded frames, one thread: time, how many, and how well they keep to the true things.
//
//   FELTMAP_DATA=DATA bench_segments [rounds=5]
//
// "Bound" is the accuracy of labels where every pixel of a segment gets the true class that most of its pixels have:
// what voting within these segments could reach at best.
#include <tbb/global_control.h>

#include <cstdio>
#include <cstdlib>
#include <map>

#include "bench/support/bench.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/labels/frame_segments.h"
#include "mapping/labels/segment_voting.h"
#include "mapping/regions/map_segments.h"

namespace {
using namespace felt;

struct Score {
  double ms = 0, segments = 0, covered = 0;
};

Score measure(const std::vector<Frame>& frames, const FrameSegmentSettings& settings, int rounds) {
  FrameSegmentScratch scratch;
  std::vector<double> times;
  Score score;
  size_t measured = 0, covered = 0;
  for (int round = 0; round < rounds; ++round)
    for (const Frame& frame : frames) {
      Image<uint16_t> segments;
      times.push_back(bench::seconds(
          [&] { segments = frame_segments(frame.depth_m, frame.camera, frame.color, settings, scratch); }));
      score.segments += *std::max_element(segments.begin(), segments.end());
      for (size_t p = 0; p < segments.size(); ++p) {
        measured += frame.depth_m.data()[p] > 0;
        covered += segments.data()[p] > 0;
      }
    }
  score.ms = 1e3 * bench::median(times);
  score.segments /= double(times.size());
  score.covered = double(covered) / double(measured);
  return score;
}

double bound(const std::vector<Frame>& frames, const FrameSegmentSettings& settings) {
  size_t right = 0, all = 0;
  FrameSegmentScratch scratch;
  for (const Frame& frame : frames) {
    LabelImage truth = frame.labels;
    for (uint16_t& id : truth)
      if (id == 0) id = kNoLabel;
    LabelImage voted = truth;
    vote_labels(frame_segments(frame.depth_m, frame.camera, frame.color, settings, scratch), 0, voted);
    for (size_t p = 0; p < truth.size(); ++p)
      if (truth.data()[p] != kNoLabel) ++all, right += voted.data()[p] == truth.data()[p];
  }
  return double(right) / double(all);
}

}  // namespace

int main(int argc, char** argv) {
  const int rounds = argc > 1 ? std::atoi(argv[1]) : 5;
  SequenceOptions icl;
  icl.frames = {0, 200, 10};
  icl.labels_dir = bench::recorded("icl_livingroom_maskrcnn") / "semantic";
  icl.classes_file = bench::recorded("icl_livingroom_maskrcnn") / "labels_40.csv";
  const std::vector<Frame> room = bench::decoded("icl_livingroom_maskrcnn", icl);
  const std::vector<Frame> kitchen = bench::decoded("7scenes_redkitchen", {.frames = {0, 160, 8}});
  FrameSegmentSettings plain;
  plain.color_step = 0;
  for (const auto& [name, frames] : {std::pair("living room, rendered", &room), {"red kitchen, Kinect", &kitchen}})
    for (const auto& [how, settings] : {std::pair("depth", plain), {"depth and colour", FrameSegmentSettings{}}}) {
      const Score score = measure(*frames, settings, rounds);
      if (score.covered < 0.8) {
        std::fprintf(stderr, "%s: segments cover %.2f of what was measured\n", name, score.covered);
        return 1;
      }
      std::printf("%-22s %-17s %d x %d: %5.1f ms, %.0f segments, cover %.3f", name, how, (*frames)[0].camera.width,
                  (*frames)[0].camera.height, score.ms, score.segments, score.covered);
      frames == &room ? std::printf(", bound %.3f\n", bound(*frames, settings)) : std::printf("\n");
    }
  Map map(0.02, 0.08);
  IntegrationScratch scratch;
  for (const Frame& frame : room) integrate(map, frame, {}, scratch);
  for (const int threads : {1, 2}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    std::vector<Region> segments;
    std::vector<double> times;
    for (int round = 0; round < rounds; ++round) times.push_back(bench::seconds([&] { segments = map_segments(map); }));
    size_t voxels = 0;
    for (const Region& region : segments) voxels += region.voxels();
    std::printf("map of the living room at 2 cm, %d threads: %.0f ms, %zu segments, %zu voxels\n", threads,
                1e3 * bench::median(times), segments.size(), voxels);
  }
  return 0;
}
