#include "io/doctor/sample.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/median.h"
#include "io/sequence/listed_sequence.h"
#include "io/sequence/recorded_pose.h"

namespace felt {
namespace {

/// Measured pixels that one frame is projected with.
constexpr int kPointsAFrame = 700;
/// Frames, at least, whose colour is looked at.
constexpr size_t kColorFrames = 10;

std::vector<int64_t> sampled_positions(int64_t count, const SamplePlan& plan) {
  std::set<int64_t> positions;
  if (count <= plan.whole_below) {
    for (int64_t i = 0; i < count; ++i) positions.insert(i);
  } else {
    for (int c = 0; c < plan.clusters; ++c)
      for (const int offset : plan.offsets)
        if (const int64_t i = c * count / plan.clusters + offset; i < count) positions.insert(i);
  }
  return {positions.begin(), positions.end()};
}

std::vector<Pair> pairs_of(const std::vector<SampledFrame>& frames, int64_t count, const SamplePlan& plan) {
  std::vector<Pair> pairs;
  const bool whole = count <= plan.whole_below;
  const int64_t reach = whole ? 13 : plan.offsets.back();
  const std::set<int64_t> steps = {1, 2, 3, 5, 8, 13};
  for (int a = 0; a < int(frames.size()); ++a)
    for (int b = a + 1; b < int(frames.size()); ++b) {
      const int64_t apart = frames[size_t(b)].position - frames[size_t(a)].position;
      if (apart <= reach && (!whole || steps.contains(apart))) pairs.push_back({a, b});
    }
  // Enough to vote; every n-th of them, so that short and long distances stay.
  constexpr size_t kMostPairs = 96;
  std::vector<Pair> kept;
  for (size_t i = 0; i < std::min(kMostPairs, pairs.size()); ++i) {
    const Pair pair = pairs[i * pairs.size() / std::min(kMostPairs, pairs.size())];
    // Forward and backward in turn: noise weighs more in a view from nearer by, and a reading that turns the camera's
    // way around must not win by that.
    kept.push_back(i % 2 == 0 ? pair : Pair{pair.b, pair.a});
  }
  return kept;
}

/// Poses of those of the frames that have one.
RecordedTrajectory recorded_trajectory(const std::vector<FrameRecord>& frames, const std::vector<int64_t>& positions) {
  RecordedTrajectory trajectory;
  std::vector<double> steps;
  for (const int64_t i : positions) {
    const FrameRecord& frame = frames[size_t(i)];
    const auto pose = recorded_pose(frame);
    if (!std::holds_alternative<Eigen::Isometry3d>(pose)) continue;
    if (!std::isfinite(frame.stamp_s) || (!trajectory.stamp.empty() && frame.stamp_s <= trajectory.stamp.back()))
      continue;
    if (!trajectory.stamp.empty()) steps.push_back(frame.stamp_s - trajectory.stamp.back());
    trajectory.position.push_back(i);
    trajectory.index.push_back(frame.index);
    trajectory.stamp.push_back(frame.stamp_s);
    trajectory.recorded.push_back(std::get<Eigen::Isometry3d>(pose));
  }
  trajectory.spacing = median(steps);
  return trajectory;
}

/// The listing with some of its frames only. The whole one, which may be large, is not copied meanwhile.
SequenceListing part_of(SequenceListing& listing, const std::vector<int64_t>& positions) {
  std::vector<FrameRecord> all = std::exchange(listing.frames, {});
  SequenceListing part = listing;
  listing.frames = std::move(all);
  for (const int64_t i : positions) part.frames.push_back(listing.frames[size_t(i)]);
  return part;
}

}  // namespace

std::unique_ptr<SequenceReader> plain_reader(const std::filesystem::path& path, const SequenceOptions& options,
                                             SequenceListing listing, Images images) {
  SequenceOptions all = options;
  all.frames = {};
  all.read_color &= images == Images::all;
  all.read_instances = false;
  listing.depth_is_ray_length = false;
  for (FrameRecord& frame : listing.frames) {
    // Nothing that the doctor looks at.
    frame.probabilities = {};
    frame.class_maps.clear();
    if (images == Images::depth) frame.labels = {};
  }
  return make_listed_sequence(path, all, std::move(listing));
}

SampledFrame sampled_frame(Frame frame, int64_t position) {
  SampledFrame sampled;
  sampled.position = position;
  sampled.index = frame.index;
  sampled.stamp = frame.stamp_s;
  sampled.depth_m = std::move(frame.depth_m);
  sampled.color = std::move(frame.color);
  sampled.labels = std::move(frame.labels);
  const DepthImage& depth = sampled.depth_m;
  // A grid dense enough that sparse depth gives points too; then every n-th of them.
  std::vector<SampledFrame::Point> points;
  const int step = std::max(1, int(std::sqrt(double(depth.size()) / (8 * kPointsAFrame))));
  for (int v = step / 2; v < depth.height(); v += step)
    for (int u = step / 2; u < depth.width(); u += step)
      if (depth(u, v) > 0) points.push_back({float(u), float(v), depth(u, v)});
  const size_t every = std::max<size_t>(1, points.size() / kPointsAFrame);
  for (size_t i = every / 2; i < points.size(); i += every) sampled.points.push_back(points[i]);
  return sampled;
}

Sample take_sample(const std::filesystem::path& path, const SequenceOptions& options, SequenceListing& listing,
                   const SamplePlan& plan) {
  Sample sample;
  GeometrySample& geometry = sample.geometry;
  const int64_t count = int64_t(listing.frames.size());
  const std::vector<int64_t> positions = sampled_positions(count, plan);
  const SequenceListing sampled = part_of(listing, positions);
  const auto reader = plain_reader(path, options, sampled, Images::depth_and_labels),
             color_reader = plain_reader(path, options, sampled, Images::all);
  geometry.camera = reader->info().camera;
  geometry.now.convention = listing.pose_convention;
  geometry.now.ray_length = listing.depth_is_ray_length;
  geometry.depth_scale = listing.depth_scale;
  geometry.stamp_offset = options.pose_stamp_offset;
  geometry.stamped = listing.stamped;
  std::vector<int64_t> posed = positions;
  if (plan.whole_trajectory) {
    posed.resize(size_t(count));
    std::iota(posed.begin(), posed.end(), int64_t(0));
  }
  geometry.trajectory = recorded_trajectory(listing.frames, posed);
  geometry.trajectory.T_body_camera = listing.T_body_camera;

  std::vector<std::optional<SampledFrame>> frames(positions.size());
  std::vector<std::string> reasons(positions.size());
  // The balance of colours needs some views only, and colour takes longest to decode.
  const size_t color_step = std::max<size_t>(1, positions.size() / kColorFrames);
  tbb::parallel_for(size_t(0), positions.size(), [&](size_t i) {
    const bool with_color = i % color_step == 0;
    ReadResult result = (with_color ? color_reader : reader)->read(int64_t(i));
    if (auto* frame = std::get_if<Frame>(&result))
      frames[i] = sampled_frame(std::move(*frame), positions[i]);
    else
      reasons[i] = std::get<SkippedFrame>(result).reason;
  });
  std::vector<double> depths;
  for (size_t i = 0; i < positions.size(); ++i) {
    if (!frames[i]) {
      ++sample.skipped[reasons[i]];
      sample.skipped_frames[reasons[i]].push_back(listing.frames[size_t(positions[i])].index);
      continue;
    }
    for (const SampledFrame::Point& point : frames[i]->points) depths.push_back(point.depth_m);
    geometry.frames.push_back(std::move(*frames[i]));
  }
  geometry.median_depth_m = median(std::move(depths));
  geometry.pairs = pairs_of(geometry.frames, count, plan);
  return sample;
}

}  // namespace felt
