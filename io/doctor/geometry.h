#pragma once

#include <vector>

#include "io/doctor/cross_projection.h"

namespace felt {

/// Everything the geometric checks look at.
struct GeometrySample {
  std::vector<SampledFrame> frames;
  std::vector<Pair> pairs;
  RecordedTrajectory trajectory;
  PinholeCamera camera;     ///< as read now
  Reading now;              ///< how the sequence is read now
  double depth_scale = 0;   ///< stored units per metre, as read now
  double stamp_offset = 0;  ///< added to the stamps of poses, as read now: seconds, or frame numbers
  bool stamped = false;     ///< stamps are seconds
  double median_depth_m = 0;
};

/// Mean score of the pairs, with a weak preference for depths of an arm's length to a room's.
double mean_score(const std::vector<PairScore>& scores, double median_depth_m);

/// Medians over the pairs that see each other.
struct Agreement {
  int pairs = 0;        ///< that see each other
  double meets = 0;     ///< share of points in view that meet the other surface
  double residual = 0;  ///< of those
};
Agreement agreement_of(const std::vector<PairScore>& scores);

/// Share of points in view that meet the other surface below which no reading is believed: in a room a quarter of them
/// do by chance.
inline constexpr double kLeastMeeting = 0.35;

/// Share of points in view that meet under a reading that fits without exception.
inline constexpr double kNearlyAll = 0.9;

/// Distance of surfaces that are exact, looked up in the nearest pixel: share of the depth.
inline constexpr double kNearestPixel = 1e-3;

/// So few frames fit a trajectory by any delay, and may show different sides of everything.
inline constexpr size_t kFewFrames = 8;

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
inline constexpr double kLeastGain = 0.08;
bool convincing(const Comparison& comparison, double least_gain = kLeastGain);

/// How far the principal point lies from the image's middle, as a score: a camera that a sequence states has it there.
double off_center(const PinholeCamera& camera);

/// Stored units per metre that recordings use.
inline constexpr double kDepthScales[] = {1, 100, 256, 1000, 5000, 6553.5, 10000};

/// The reading under which the sample fits together best, as few changes from `sample.now` as the evidence asks for.
/// `thorough`: also any depth scale, focal length and delay; else conventions, known scales and ray length. Quaternions
/// written w x y z are thought of where no reading fits as it is, or one with other poses does.
Reading best_reading(const GeometrySample& sample, bool thorough);

}  // namespace felt
