#include "io/doctor/trajectory_check.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include "core/median.h"
#include "core/text.h"
#include "io/doctor/sample.h"

namespace felt {
namespace {

bool overlaps(const PairScore& score) { return score.in_view > 0.1; }
/// A pair whose frames see each other and whose surfaces mostly meet.
bool fits(const PairScore& score) { return overlaps(score) && score.meets > 0.4; }

/// Fewer pairs that overlap say nothing.
constexpr int kLeastOverlappingPairs = 3;

struct Step {
  size_t from = 0;  ///< position in the trajectory
  double turn_rad = 0, way_m = 0;
};

/// The largest steps by way and by turn, from frames that follow one another.
std::vector<size_t> largest_steps(const RecordedTrajectory& trajectory) {
  constexpr size_t kTried = 6;
  std::vector<Step> steps;
  for (size_t i = 0; i + 1 < trajectory.recorded.size(); ++i) {
    if (trajectory.stamp[i + 1] - trajectory.stamp[i] > 1.5 * trajectory.spacing) continue;
    const Eigen::Isometry3d move = trajectory.recorded[i].inverse() * trajectory.recorded[i + 1];
    steps.push_back({i, Eigen::AngleAxisd(move.linear()).angle(), move.translation().norm()});
  }
  std::set<size_t> chosen;
  for (double Step::*size : {&Step::way_m, &Step::turn_rad}) {
    std::stable_sort(steps.begin(), steps.end(), [&](const Step& a, const Step& b) { return a.*size > b.*size; });
    for (size_t i = 0; i < std::min(kTried, steps.size()); ++i) chosen.insert(steps[i].from);
  }
  return {chosen.begin(), chosen.end()};
}

/// Median distance between frames that follow one another, as a share of the median between any two.
double smoothness(const RecordedTrajectory& trajectory) {
  std::vector<double> near, any;
  const size_t count = trajectory.recorded.size();
  const auto distance = [&](size_t a, size_t b) {
    const Eigen::Isometry3d move = trajectory.recorded[a].inverse() * trajectory.recorded[b];
    return move.translation().norm() + Eigen::AngleAxisd(move.linear()).angle();
  };
  for (size_t i = 0; i + 1 < count; ++i) {
    near.push_back(distance(i, i + 1));
    any.push_back(distance(i, (i + 1 + (i * 7919) % (count - 1)) % count));
  }
  return median(std::move(near)) / std::max(1e-9, median(std::move(any)));
}

/// How many of the sampled frames fit their neighbours better with the pose of another frame, which fits better in
/// turn: none where poses are in order.
int better_exchanged(const GeometrySample& sample, const Reading& reading) {
  constexpr int kEvery = 2;
  RecordedTrajectory trajectory = sample.trajectory;
  const auto place = [&](int frame) {
    const auto& positions = trajectory.position;
    const int64_t position = sample.frames[size_t(frame)].position;
    return size_t(std::lower_bound(positions.begin(), positions.end(), position) - positions.begin());
  };
  const std::vector<PairScore> all =
      cross_project(sample.frames, sample.pairs, trajectory, sample.camera, reading, kEvery);
  std::set<int> exchanged;
  for (int a = 0; a < int(sample.frames.size()); ++a)
    for (int b = a + 1; b < int(sample.frames.size()); ++b) {
      std::vector<Pair> pairs;
      std::vector<PairScore> now;
      for (size_t i = 0; i < sample.pairs.size(); ++i) {
        const Pair pair = sample.pairs[i];
        // The pair of both is seen from the other side, which says nothing.
        if ((pair.a == a || pair.b == a) == (pair.a == b || pair.b == b)) continue;
        pairs.push_back(pair), now.push_back(all[i]);
      }
      if (pairs.size() < 3) continue;
      std::swap(trajectory.recorded[place(a)], trajectory.recorded[place(b)]);
      const std::vector<PairScore> then =
          cross_project(sample.frames, pairs, trajectory, sample.camera, reading, kEvery);
      std::swap(trajectory.recorded[place(a)], trajectory.recorded[place(b)]);
      if (convincing(compare(now, then))) exchanged.insert({a, b});
    }
  return int(exchanged.size());
}

/// Frames of trajectory positions [first, last], decoded; nothing for those that cannot be read.
std::vector<SampledFrame> decode(const RecordedTrajectory& trajectory, size_t first, size_t last,
                                 const SequenceReader& reader) {
  std::vector<SampledFrame> frames;
  for (size_t i = first; i <= last; ++i) {
    ReadResult result = reader.read(trajectory.position[i]);
    if (auto* frame = std::get_if<Frame>(&result))
      frames.push_back(sampled_frame(std::move(*frame), trajectory.position[i]));
  }
  return frames;
}

}  // namespace

Finding check_trajectory(const GeometrySample& sample, const Reading& best, const SequenceReader& reader) {
  Finding finding{"trajectory", false, 0.9, "the trajectory is continuous and fits the images", "", ""};
  const RecordedTrajectory& trajectory = sample.trajectory;
  std::map<int, Pair> nearest;
  for (const Pair& either : sample.pairs) {
    const Pair pair{std::min(either.a, either.b), std::max(either.a, either.b)};
    if (const auto [at, is_new] = nearest.emplace(pair.a, pair); !is_new && pair.b < at->second.b) at->second = pair;
  }
  std::vector<Pair> neighbours;
  for (const auto& [a, pair] : nearest) neighbours.push_back(pair);
  const std::vector<PairScore> scores = cross_project(sample.frames, neighbours, trajectory, sample.camera, best);
  const auto overlapping = std::count_if(scores.begin(), scores.end(), overlaps);
  const auto fitting = std::count_if(scores.begin(), scores.end(), fits);
  // A few frames of a sound recording may show different sides of everything; many overlap.
  const auto asked = sample.frames.size() < kFewFrames ? size_t(overlapping) : scores.size();
  const double share = asked == 0 ? 1 : double(fitting) / double(asked);
  finding.evidence =
      std::to_string(fitting) + " of " + std::to_string(asked) + " neighbouring frame pairs see the same surface";
  // Poses that are told a delay are between frames: which of them is whose cannot be asked.
  const bool slow = share >= 0.5 && best.pose_delay == 0;
  const int exchanged = slow && overlapping >= kLeastOverlappingPairs ? better_exchanged(sample, best) : 0;
  const bool disordered = exchanged >= 3 && exchanged >= 0.4 * double(sample.frames.size());
  if (overlapping < kLeastOverlappingPairs) {
    finding.confidence = 0.5;
    finding.belief = "it cannot be told whether the trajectory fits the images: too few views overlap";
    return finding;
  } else if (share < 0.5 || disordered) {
    const double rough = smoothness(trajectory);
    finding.faulty = true;
    finding.confidence = disordered ? 0.8 : std::min(0.97, 1 - share);
    if (disordered)
      finding.evidence += "; " + std::to_string(exchanged) + " of " + std::to_string(sample.frames.size()) +
                          " frames fit better with the pose of another";
    finding.belief = disordered || rough > 0.5 ? "poses are in another order than the images (shuffled)"
                                               : "poses do not belong to these images";
    finding.evidence +=
        "; a step of the trajectory is " + number_text(100 * rough, "%.0f") + " % of the way between any two poses";
    finding.remedy = "no option mends it: take poses and images of the same recording, in the same order";
    return finding;
  }
  std::vector<int64_t> jumps;
  for (const size_t from : largest_steps(trajectory)) {
    const size_t first = from > 0 ? from - 1 : from, last = std::min(from + 2, trajectory.recorded.size() - 1);
    const std::vector<SampledFrame> frames = decode(trajectory, first, last, reader);
    if (frames.size() < last - first + 1 || frames.size() < 3) continue;
    std::vector<Pair> pairs;
    for (int i = 0; i + 1 < int(frames.size()); ++i) pairs.push_back({i, i + 1});
    const std::vector<PairScore> around = cross_project(frames, pairs, trajectory, sample.camera, best);
    const size_t across = from - first;
    // Score of a point in view: a quarter of a room's surfaces meet themselves after any jump.
    const auto per_point = [](const PairScore& score) { return score.score / std::max(0.01, score.in_view); };
    const auto step = [&](size_t i) { return trajectory.stamp[first + i + 1] - trajectory.stamp[first + i]; };
    bool others_fit = true, any_other = false;
    double worst_other = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < around.size(); ++i) {
      // Views a much longer time apart say nothing of this step.
      if (i == across || step(i) > 3 * step(across)) continue;
      any_other = true;
      others_fit &= fits(around[i]);
      worst_other = std::min(worst_other, per_point(around[i]));
    }
    if (any_other && others_fit && (around[across].in_view < 0.05 || per_point(around[across]) < 0.5 * worst_other))
      jumps.push_back(trajectory.index[from + 1]);
  }
  if (jumps.empty()) return finding;
  finding.faulty = true;
  finding.confidence = 0.9;
  finding.belief = "the trajectory jumps at frame " + std::to_string(jumps.front());
  for (size_t i = 1; i < jumps.size(); ++i) finding.belief += ", " + std::to_string(jumps[i]);
  finding.evidence = "surfaces fit beside each jump, but not across it";
  finding.remedy = "reconstruct the parts on their own with --frames";
  return finding;
}

}  // namespace felt
