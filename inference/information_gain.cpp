#include "inference/information_gain.h"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>
#include <limits>
#include <vector>

namespace felt {
namespace {

using Rule = boost::math::quadrature::gauss_kronrod<double, 15>;
constexpr double kTolerance = 1e-9;
constexpr int kMaxDepth = 12;
// Weights below this change no result; their components need no points of their own.
constexpr double kNegligibleWeight = 1e-12;

struct Support {
  std::vector<double> edge;  // ascending: panels no wider than the narrowest component they cross
  double lowest_dof = 0;
};

Support support_of(const StudentTMixture& m) {
  Support s;
  s.lowest_dof = std::numeric_limits<double>::infinity();
  double narrowest = s.lowest_dof;
  for (size_t c = 0; c < m.weight.size(); ++c) {
    if (m.weight[c] < kNegligibleWeight) continue;
    const StudentT& t = m.component[c];
    const double scale = std::sqrt(t.scale2);
    for (double z : {-30.0, -10.0, -4.0, -1.5, 0.0, 1.5, 4.0, 10.0, 30.0}) s.edge.push_back(t.location + z * scale);
    s.lowest_dof = std::min(s.lowest_dof, t.dof);
    narrowest = std::min(narrowest, scale);
  }
  std::sort(s.edge.begin(), s.edge.end());
  std::vector<double> kept;
  for (double x : s.edge)
    if (kept.empty() || x - kept.back() > 0.5 * narrowest) kept.push_back(x);
  s.edge = std::move(kept);
  return s;
}

// Integral over the real line of f(x), which decays as the mixture's density does (times a logarithm).
template <class F>
Estimate integrate(const StudentTMixture& m, F f) {
  const Support s = support_of(m);
  Estimate total;
  const auto add = [&](auto g, double from, double to) {
    double error = 0;
    const double value = Rule::integrate(g, from, to, kMaxDepth, kTolerance, &error);
    total.value += value;
    // The rule's own estimate is the difference to its embedded Gauss rule; rounding comes on top.
    total.error += error + 1e-15 * std::abs(value);
  };
  for (size_t i = 0; i + 1 < s.edge.size(); ++i) add(f, s.edge[i], s.edge[i + 1]);

  // Tails: x = end +- width (e^u - 1), where the integrand falls as e^(-dof u).
  const double low = s.edge.front(), high = s.edge.back(), width = high - low;
  const double longest = std::log(std::numeric_limits<double>::max()) / 2 - std::max(0.0, std::log(width));
  const double reach = std::min(45 / s.lowest_dof + 5, std::max(longest, 5.0));
  for (double side : {-1.0, 1.0}) {
    const double end = side < 0 ? low : high;
    const auto tail = [&](double u) { return f(end + side * width * std::expm1(u)) * width * std::exp(u); };
    double step = 0.5;
    for (double u = 0; u < reach; u += step, step = std::min(1.25 * step, 4 / s.lowest_dof + 1)) {
      add(tail, u, std::min(u + step, reach));
    }
    // What lies beyond: the last value times the decay length.
    total.error += std::abs(tail(reach)) / s.lowest_dof;
  }
  return total;
}

}  // namespace

Estimate entropy(const StudentTMixture& m) {
  return integrate(m, [&](double x) {
    const double log_density = log_pdf(m, x);
    return -std::exp(log_density) * log_density;
  });
}

Estimate information_gain(const StudentTMixture& predictive) {
  Estimate gain = integrate(predictive, [&](double x) {
    const double log_density = log_pdf(predictive, x);
    double sum = 0;
    for (size_t c = 0; c < predictive.weight.size(); ++c) {
      if (!(predictive.weight[c] > 0)) continue;
      const double log_component = log_pdf(predictive.component[c], x);
      sum += predictive.weight[c] * std::exp(log_component) * (log_component - log_density);
    }
    return sum;
  });
  gain.value = std::max(gain.value, 0.0);
  return gain;
}

}  // namespace felt
