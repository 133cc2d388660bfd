#include "io/doctor/geometry.h"

#include <algorithm>
#include <cmath>
#include <functional>

namespace felt {
namespace {

/// Score that each change from the reading as it is has to earn: the sequence is taken at its word unless it errs.
constexpr double kCostOfChange = 0.02;
/// Score by which a right focal length, scale or delay raises a reading at most that is right in all else.
constexpr double kOvertakes = 1;

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
                        (r.pose_delay != 0);
    const std::vector<PairScore> scores =
        cross_project(sample_.frames, sample_.pairs, sample_.trajectory, sample_.camera, r, every);
    return mean_score(scores, sample_.median_depth_m * r.depth_factor) - kCostOfChange * changes -
           4 * off_center(camera_of(sample_.camera, r));
  }

private:
  /// How far the principal point lies from the image's centre: squared shares of width and height.
  static double off_center(const PinholeCamera& c) {
    const double x = (c.cx + 0.5) / c.width - 0.5, y = (c.cy + 0.5) / c.height - 0.5;
    return x * x + y * y;
  }
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

Candidate refined(const Search& search, Candidate candidate, const GeometrySample& sample) {
  const double range = std::max(sample.stamped ? 0.12 : 0.0, 2 * sample.trajectory.spacing);
  std::vector<double> delays;
  for (int i = -16; i <= 16; ++i) delays.push_back(range * i / 16);
  for (int round = 0; round < 2; ++round) {
    const double before = candidate.value;
    std::vector<Candidate> singles = {
        swept(search, candidate, &Reading::focal_factor, geometric(0.5, 2, 24), true),
        swept(search, candidate, &Reading::depth_factor,
              geometric(candidate.reading.depth_factor / 64, candidate.reading.depth_factor * 64, 48), true)};
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

Reading best_reading(const GeometrySample& sample, bool thorough) {
  const Search search(sample);
  std::vector<double> factors = {1};
  for (const double scale : kDepthScales)
    if (scale != sample.depth_scale) factors.push_back(sample.depth_scale / scale);
  const PinholeCamera& camera = sample.camera;
  const bool may_be_swapped = std::abs(camera.cx - camera.cy) > 0.02 * camera.width || camera.fx != camera.fy;

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
    for (Candidate& candidate : candidates) candidate = refined(search, candidate, sample);
    std::stable_sort(candidates.begin(), candidates.end(), better);
  }
  return candidates.front().reading;
}

}  // namespace felt
