#pragma once

#include <vector>

#include "io/doctor/cross_projection.h"

namespace felt {

/// Everything the geometric checks look at.
struct GeometrySample {
  std::vector<SampledFrame> frames;
  std::vector<Pair> pairs;
  RecordedTrajectory trajectory;
  PinholeCamera camera;    ///< as read now
  Reading now;             ///< how the sequence is read now
  double depth_scale = 0;  ///< stored units per metre, as read now
  bool stamped = false;    ///< stamps are seconds
  double median_depth_m = 0;
};

/// Mean score of the pairs, with a weak preference for depths of an arm's length to a room's.
double mean_score(const std::vector<PairScore>& scores, double median_depth_m);

/// `other` against `base`, pair by pair.
struct Comparison {
  double gain = 0;  ///< mean difference of scores
  int decided = 0;  ///< pairs whose scores differ enough to tell
  int won = 0;      ///< of those, by `other`
  /// Share of the deciding pairs that `other` wins, drawn towards 1/2 where there are few.
  double confidence() const { return (won + 0.5) / (decided + 1.0); }
};
Comparison compare(const std::vector<PairScore>& base, const std::vector<PairScore>& other);

/// True where the evidence is strong enough to accuse `base`: the mean gain is at least `least_gain`, and three
/// quarters of the deciding pairs agree.
bool convincing(const Comparison& comparison, double least_gain = 0.08);

/// Stored units per metre that recordings use.
inline constexpr double kDepthScales[] = {1, 100, 256, 1000, 5000, 6553.5, 10000};

/// The reading under which the sample fits together best, as few changes from `sample.now` as the evidence asks for.
/// `thorough`: also any depth scale, focal length and delay; else conventions, known scales and ray length.
Reading best_reading(const GeometrySample& sample, bool thorough);

}  // namespace felt
