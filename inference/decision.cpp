#include "inference/decision.h"

#include <algorithm>
#include <boost/math/quadrature/sinh_sinh.hpp>
#include <boost/math/tools/minima.hpp>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

namespace felt {
namespace {

/// P(|draw - location + N(0, noise_sd^2)| >= distance). A Student-t is a normal of variance scale2/u, u ~ Gamma(dof/2,
/// dof/2), so the noise adds to the variance of each of these normals; what is left is an integral over ln u.
double noisy_tail(const StudentT& t, double distance, double noise_sd) {
  boost::math::quadrature::sinh_sinh<double> rule;
  const double shape = t.dof / 2, width = 1 / std::sqrt(shape);
  const auto over_precision = [&](auto f) {
    return rule.integrate([&](double x) {
      const double log_u = std::min(x * width, 300.0);  // beyond, u has no density left
      return std::exp(shape * (log_u - std::expm1(log_u))) * f(std::exp(log_u));
    });
  };
  const double mass = over_precision([](double) { return 1.0; });
  const double noise2 = noise_sd * noise_sd;
  return over_precision([&](double u) { return std::erfc(distance / std::sqrt(2 * (t.scale2 / u + noise2))); }) / mass;
}

}  // namespace

double class_entropy(std::span<const double> p) {
  double sum = 0;
  for (double x : p) sum -= x > 0 ? x * std::log(x) : 0;
  return sum;
}

int most_probable_class(std::span<const double> p) { return int(std::max_element(p.begin(), p.end()) - p.begin()); }

void apply_belief_floor(std::span<double> belief, double floor) {
  assert(floor >= 0 && floor * double(belief.size()) < 1);
  const double total = std::accumulate(belief.begin(), belief.end(), 0.0);
  const double least = floor * total;
  // Rescaling may push further entries below the floor; each round settles at least one, so k rounds suffice.
  for (size_t round = 0; round < belief.size(); ++round) {
    double raised = 0, free = 0;
    for (double x : belief) (x <= least ? raised : free) += x <= least ? least : x;
    const double scale = (total - raised) / free;
    bool settled = true;
    for (double& x : belief) {
      x = x <= least ? least : x * scale;
      settled = settled && x >= least;
    }
    if (settled) return;
  }
}

double tail_probability(const StudentTMixture& predictive, double psi, double noise_sd) {
  double sum = 0;
  for (size_t c = 0; c < predictive.weight.size(); ++c) {
    if (!(predictive.weight[c] > 0)) continue;
    const StudentT& t = predictive.component[c];
    const double distance = std::abs(psi - t.location);
    const double tail = noise_sd > 0 ? noisy_tail(t, distance, noise_sd) : 2 * cdf(t, t.location - distance);
    sum += predictive.weight[c] * tail;
  }
  return sum;
}

std::vector<double> modes(const StudentTMixture& m, double least_height, double deepest_ridge) {
  // Every mode lies between the outermost locations; points of each component are denser than its own width.
  constexpr int kPointsPerSide = 24;
  std::vector<double> x;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  for (size_t c = 0; c < m.weight.size(); ++c) {
    if (!(m.weight[c] > 0)) continue;
    const StudentT& t = m.component[c];
    low = std::min(low, t.location);
    high = std::max(high, t.location);
    for (int i = -kPointsPerSide; i <= kPointsPerSide; ++i) {
      x.push_back(t.location + 0.125 * i * std::sqrt(t.scale2));
    }
  }
  std::erase_if(x, [&](double at) { return at < low || at > high; });
  std::sort(x.begin(), x.end());
  x.erase(std::unique(x.begin(), x.end()), x.end());
  std::vector<double> height(x.size());
  std::transform(x.begin(), x.end(), height.begin(), [&](double at) { return pdf(m, at); });
  const double tallest = *std::max_element(height.begin(), height.end());

  const auto refined = [&](const std::vector<double>& at, size_t i) {
    constexpr int kBits = 30;
    const double left = at[i > 0 ? i - 1 : i], right = at[i + 1 < at.size() ? i + 1 : i];
    if (!(left < right)) return at[i];
    const double top =
        boost::math::tools::brent_find_minima([&](double y) { return -pdf(m, y); }, left, right, kBits).first;
    return pdf(m, top) > height[i] ? top : at[i];
  };

  // Walk up and down: a peak counts once the density has since fallen below its ridge and had risen as far before.
  std::vector<double> result;
  size_t peak = 0;
  double valley = 0;  // lowest since the last peak that counted; nothing lies left of the first point
  bool rising = true;
  for (size_t i = 0; i <= x.size(); ++i) {
    const double h = i < x.size() ? height[i] : 0;
    if (rising) {
      if (i < x.size() && h > height[peak]) peak = i;
      if (h < deepest_ridge * height[peak] && valley < deepest_ridge * height[peak]) {
        if (height[peak] >= least_height * tallest) result.push_back(refined(x, peak));
        rising = false;
        valley = h;
      }
    } else if (h < valley) {
      valley = h;
    } else if (i < x.size() && valley < deepest_ridge * h) {
      rising = true;
      peak = i;
    }
  }
  return result;
}

RegionFlags region_flags(const StudentTMixture& predictive, double psi, double noise_sd) {
  RegionFlags flags;
  flags.surprising = tail_probability(predictive, psi, noise_sd) < kSurprising;
  flags.multi_modal = modes(predictive).size() > 1;
  flags.not_one_material = flags.surprising && class_entropy(predictive.weight) > kMixedEntropy;
  return flags;
}

}  // namespace felt
