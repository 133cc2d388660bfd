#include "inference/information_gain.h"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

namespace felt {
namespace {

using Rule = boost::math::quadrature::gauss_kronrod<double, 15>;
constexpr double kTolerance = 1e-11;  // of the whole integral, for one panel
constexpr int kMaxDepth = 12;
// Weights below this change no result; their components need no points of their own.
constexpr double kNegligibleWeight = 1e-12;

struct Support {
  std::vector<double> edge;  // ascending: panels no wider than the narrowest component they cross
  double lowest_dof = 0;
  bool resolved = true;  // else a component is so narrow that doubles around its location do not tell its parts apart
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
    constexpr double kLeastShare = 1e-12;
    s.resolved &= scale > kLeastShare * std::abs(t.location);
  }
  std::sort(s.edge.begin(), s.edge.end());
  std::vector<double> kept;
  for (double x : s.edge)
    if (kept.empty() || x - kept.back() > 0.5 * narrowest) kept.push_back(x);
  s.edge = std::move(kept);
  return s;
}

Estimate one_panel(const std::function<double(double)>& g, double from, double to) {
  Estimate panel;
  panel.value = Rule::integrate(g, from, to, 0, 0.0, &panel.error);
  return panel;
}

// Halves a panel as long as its error is above `tolerance`. Absolute: a panel across which the integrand changes sign,
// or that holds next to nothing, would never reach a share of its own integral.
Estimate refined(const std::function<double(double)>& g, double from, double to, const Estimate& panel,
                 double tolerance, int depth) {
  if (!(panel.error > tolerance) || depth == 0) return panel;
  const double middle = from + (to - from) / 2;
  const Estimate left = refined(g, from, middle, one_panel(g, from, middle), tolerance / 2, depth - 1);
  const Estimate right = refined(g, middle, to, one_panel(g, middle, to), tolerance / 2, depth - 1);
  return {left.value + right.value, left.error + right.error};
}

// Integral over the real line of f(x), which decays as the mixture's density does (times a logarithm).
Estimate integrate(const StudentTMixture& m, const std::function<double(double)>& f) {
  const Support s = support_of(m);
  struct Panel {
    std::function<double(double)> g;
    double from = 0, to = 0;
    Estimate first;
  };
  std::vector<Panel> panels;
  double size = 0;
  const auto add = [&](const std::function<double(double)>& g, double from, double to) {
    panels.push_back({g, from, to, one_panel(g, from, to)});
    size += std::abs(panels.back().first.value);
  };
  for (size_t i = 0; i + 1 < s.edge.size(); ++i) add(f, s.edge[i], s.edge[i + 1]);

  // Tails: x = end +- width (e^u - 1), where the integrand falls as e^(-dof u).
  Estimate total;
  const double low = s.edge.front(), high = s.edge.back(), width = high - low;
  const double longest = std::log(std::numeric_limits<double>::max()) / 2 - std::max(0.0, std::log(width));
  const double reach = std::min(45 / s.lowest_dof + 5, std::max(longest, 5.0));
  for (double side : {-1.0, 1.0}) {
    const double end = side < 0 ? low : high;
    const auto tail = [&f, end, side, width](double u) {
      return f(end + side * width * std::expm1(u)) * width * std::exp(u);
    };
    double step = 0.5;
    for (double u = 0; u < reach; u += step, step = std::min(1.25 * step, 4 / s.lowest_dof + 1)) {
      add(tail, u, std::min(u + step, reach));
    }
    // What lies beyond: the last value times the decay length.
    total.error += std::abs(tail(reach)) / s.lowest_dof;
  }
  for (const Panel& p : panels) {
    const Estimate panel = refined(p.g, p.from, p.to, p.first, kTolerance * size, kMaxDepth);
    total.value += panel.value;
    // The rule's own estimate is the difference to its embedded Gauss rule; rounding comes on top.
    total.error += panel.error + 1e-15 * std::abs(panel.value);
  }
  if (!s.resolved) total.error = std::numeric_limits<double>::infinity();
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
  // What a reading can teach about the class is what is not known about it.
  double class_entropy = 0;
  for (const double w : predictive.weight)
    if (w > 0) class_entropy -= w * std::log(w);
  gain.error = std::max(gain.error, gain.value - class_entropy);
  gain.value = std::clamp(gain.value, 0.0, std::max(0.0, class_entropy));
  return gain;
}

}  // namespace felt
