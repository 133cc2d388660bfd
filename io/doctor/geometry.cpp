#include "io/doctor/geometry.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/median.h"

namespace felt {
namespace {

/// Score that each change from the reading as it is has to earn: the sequence is taken at its word unless it errs.
constexpr double kCostOfChange = 0.02;
/// Score by which a right focal length, scale or delay raises a reading at most that is right in all else.
constexpr double kOvertakes = 1;
/// Score that the camera's way has to earn for a scale to be told from it, and three quarters of the pairs agree.
constexpr double kLeastParallax = 0.05;

class Search {
public:
  Search(const GeometrySample& sample) : sample_(sample) {}

  /// Every n-th point is projected.
  enum Fineness { coarse = 9, fine = 3 };

  double value(const Reading& r, Fineness every = fine) const {
    const Reading& now = sample_.now;
    const int changes = (r.convention.world_to_camera != now.convention.world_to_camera) +
                        (r.convention.opengl_axes != now.convention.opengl_axes) + (r.depth_factor != 1) +
                        (r.ray_length != now.ray_length) + (r.focal_factor != 1) + r.swapped_camera +
                        (r.pose_delay != 0) + r.w_first;
    const std::vector<PairScore> scores =
        cross_project(sample_.frames, sample_.pairs, sample_.trajectory, sample_.camera, r, every);
    return mean_score(scores, sample_.median_depth_m * r.depth_factor) - kCostOfChange * changes -
           off_center(camera_of(sample_.camera, r));
  }

private:
  const GeometrySample& sample_;
};

struct Candidate {
  Reading reading;
  double value = 0;
};

/// Changes one number of the reading by a sweep over few points, then halves the step around the best with more.
Candidate swept(const Search& search, const Candidate& start, double Reading::*number,
                const std::vector<double>& values, bool logarithmic) {
  Reading coarse = start.reading;
  double coarse_value = search.value(coarse, Search::coarse), step = 0;
  for (size_t i = 0; i < values.size(); ++i) {
    Reading next = start.reading;
    next.*number = values[i];
    const double value = search.value(next, Search::coarse);
    if (value <= coarse_value) continue;
    coarse = next, coarse_value = value;
    const double other = values[i > 0 ? i - 1 : i + 1];
    step = logarithmic ? std::abs(std::log(values[i] / other)) : std::abs(values[i] - other);
  }
  if (coarse == start.reading) return start;
  Candidate best{coarse, search.value(coarse)};
  for (int halving = 0; halving < 5; ++halving) {
    step /= 2;
    const double middle = best.reading.*number;
    for (const double side : {-step, step}) {
      Candidate next = best;
      next.reading.*number = logarithmic ? middle * std::exp(side) : middle + side;
      next.value = search.value(next.reading);
      if (next.value > best.value) best = next;
    }
  }
  return best.value > start.value ? best : start;
}

std::vector<double> geometric(double from, double to, int steps) {
  std::vector<double> values;
  for (int i = 0; i <= steps; ++i) values.push_back(from * std::pow(to / from, double(i) / steps));
  return values;
}

/// A factor near that of a known scale takes its value where the score hardly suffers.
Candidate with_known_scale(const Search& search, Candidate candidate, double scale_now) {
  if (candidate.reading.depth_factor == 1) return candidate;
  for (const double scale : kDepthScales) {
    Candidate known = candidate;
    known.reading.depth_factor = scale_now / scale;
    if (std::abs(std::log(known.reading.depth_factor / candidate.reading.depth_factor)) > 0.06) continue;
    known.value = search.value(known.reading);
    if (known.value > candidate.value - 0.05) return known;
  }
  return candidate;
}

Candidate refined(const Search& search, Candidate candidate, const GeometrySample& sample, bool any_scale) {
  const double range = std::max(sample.stamped ? 0.12 : 0.0, 2 * sample.trajectory.spacing);
  std::vector<double> delays;
  for (int i = -16; i <= 16; ++i) delays.push_back(range * i / 16);
  for (int round = 0; round < 2; ++round) {
    const double before = candidate.value;
    std::vector<Candidate> singles = {swept(search, candidate, &Reading::focal_factor, geometric(0.5, 2, 24), true)};
    if (any_scale)
      singles.push_back(swept(search, candidate, &Reading::depth_factor,
                              geometric(candidate.reading.depth_factor / 64, candidate.reading.depth_factor * 64, 48),
                              true));
    if (sample.trajectory.spacing > 0) singles.push_back(swept(search, candidate, &Reading::pose_delay, delays, false));
    for (const Candidate& single : singles)
      if (single.value > candidate.value) candidate = single;
    candidate = with_known_scale(search, candidate, sample.depth_scale);
    if (candidate.value <= before + 0.02) break;
  }
  return candidate;
}

}  // namespace

double mean_score(const std::vector<PairScore>& scores, double median_depth_m) {
  double sum = 0;
  for (const PairScore& score : scores) sum += score.score;
  const double off = std::log(std::max(1e-9, median_depth_m) / 1.5) / 1.2;
  return sum / double(std::max<size_t>(1, scores.size())) - 0.05 * off * off;
}

Agreement agreement_of(const std::vector<PairScore>& scores) {
  std::vector<double> meets, residuals;
  for (const PairScore& score : scores) {
    if (score.in_view < 0.05) continue;
    meets.push_back(score.meets);
    if (score.meets > 0) residuals.push_back(score.residual);
  }
  const int pairs = int(meets.size());
  return {pairs, median(std::move(meets)), median(std::move(residuals))};
}

double off_center(const PinholeCamera& c) {
  // Squared shares of width and height: 0.17 for the camera of an upright image of 4:3 in one that lies.
  const double x = (c.cx + 0.5) / c.width - 0.5, y = (c.cy + 0.5) / c.height - 0.5;
  return 4 * (x * x + y * y);
}

Comparison compare(const std::vector<PairScore>& base, const std::vector<PairScore>& other) {
  Comparison comparison;
  for (size_t i = 0; i < base.size(); ++i) {
    const double gain = other[i].score - base[i].score;
    comparison.gain += gain / double(base.size());
    if (std::abs(gain) < 0.05) continue;
    ++comparison.decided;
    comparison.won += gain > 0;
  }
  return comparison;
}

bool convincing(const Comparison& comparison, double least_gain) {
  return comparison.gain > least_gain && comparison.decided >= 3 && comparison.won >= 0.75 * comparison.decided;
}

namespace {

Reading search_best(const GeometrySample& sample, bool thorough, bool any_scale, bool w_first) {
  const Search search(sample);
  std::vector<double> factors = {1};
  for (const double scale : kDepthScales)
    if (any_scale && scale != sample.depth_scale) factors.push_back(sample.depth_scale / scale);
  const PinholeCamera& camera = sample.camera;
  // Exchanging back brings the principal point towards the image's middle. Where it takes it away from there, the
  // exchange would only stand in for a focal length that is wrong.
  const bool differs = std::abs(camera.cx - camera.cy) > 0.02 * camera.width || camera.fx != camera.fy;
  Reading exchanged;
  exchanged.swapped_camera = true;
  const bool may_be_swapped = differs && off_center(camera_of(camera, exchanged)) < off_center(camera) + 0.02;

  std::vector<Candidate> candidates;
  for (const bool inverse : {false, true})
    for (const bool flipped : {false, true})
      for (const double factor : factors)
        for (const bool ray : {false, true})
          for (const bool swapped : {false, true}) {
            if (swapped && !may_be_swapped) continue;
            Reading reading = sample.now;
            reading.convention.world_to_camera ^= inverse;
            reading.convention.opengl_axes ^= flipped;
            reading.depth_factor = factor;
            reading.ray_length ^= ray;
            reading.swapped_camera = swapped;
            reading.w_first = w_first;
            candidates.push_back({reading, search.value(reading)});
          }
  const auto better = [](const Candidate& a, const Candidate& b) { return a.value > b.value; };
  const Candidate as_is = candidates.front();
  std::stable_sort(candidates.begin(), candidates.end(), better);
  if (thorough) {
    // What fits much worse than the best does not overtake it by a number.
    const double least = candidates.front().value - kOvertakes;
    std::erase_if(candidates, [&](const Candidate& c) { return c.value < least || c.reading == as_is.reading; });
    candidates.resize(std::min<size_t>(candidates.size(), 3));
    candidates.push_back(as_is);
    for (Candidate& candidate : candidates) candidate = refined(search, candidate, sample, any_scale);
    std::stable_sort(candidates.begin(), candidates.end(), better);
  }
  return candidates.front().reading;
}

/// Whether the camera's way says how large things are: views that fit as well were the camera only turning do not.
bool shows_scale(const GeometrySample& sample, const Reading& reading) {
  Reading turning = reading;
  turning.depth_factor = 1e6;  // beside such depth no way counts
  const auto scores = [&](const Reading& r) {
    return cross_project(sample.frames, sample.pairs, sample.trajectory, sample.camera, r);
  };
  return convincing(compare(scores(turning), scores(reading)), kLeastParallax);
}

/// Surfaces that meet as well as rendered ones do, stored in steps and looked up in the nearest pixel: what another
/// reading gains there is rounding.
bool leaves_nothing_to_explain(const Agreement& agreement, const GeometrySample& sample) {
  const double half_step = 0.5 / (sample.depth_scale * std::max(1e-9, sample.median_depth_m));
  return agreement.pairs > 0 && agreement.meets >= kNearlyAll &&
         agreement.residual <= std::max(half_step, kNearestPixel);
}

}  // namespace

Reading best_reading(const GeometrySample& sample, bool thorough) {
  const auto search = [&](bool w_first) {
    const Reading best = search_best(sample, thorough, true, w_first);
    return best.depth_factor == 1 || shows_scale(sample, best) ? best : search_best(sample, thorough, false, w_first);
  };
  const auto scores = [&](const Reading& reading) {
    return cross_project(sample.frames, sample.pairs, sample.trajectory, sample.camera, reading);
  };
  const Agreement now = agreement_of(scores(sample.now));
  if (leaves_nothing_to_explain(now, sample)) return sample.now;
  const Reading best = search(false);
  const std::vector<PairScore> best_scores = scores(best);
  // Where little is in view a search may end where hardly anything meets.
  if (agreement_of(best_scores).meets < kLeastMeeting && now.meets >= kLeastMeeting) return sample.now;
  // Few sequences store quaternions: none is asked about them that fits with its poses as they are.
  constexpr double kFits = 0.5;
  if (best.convention == sample.now.convention && agreement_of(best_scores).meets >= kFits) return best;
  const Reading w_first = search(true);
  const std::vector<PairScore> w_first_scores = scores(w_first);
  return agreement_of(w_first_scores).meets >= kFits && convincing(compare(best_scores, w_first_scores)) ? w_first
                                                                                                         : best;
}

}  // namespace felt
