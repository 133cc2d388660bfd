#include "inference/student_t.h"

#include <algorithm>
#include <bit>
#include <boost/math/special_functions/beta.hpp>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

#include "inference/special_functions.h"

namespace felt {
namespace {

constexpr double kLargest = std::numeric_limits<double>::max();

// ln B(dof/2, 1/2)
double log_beta_half(double dof) { return 0.5 * std::log(std::numbers::pi) - log_gamma_difference(dof / 2, 0.5); }

// P(T > z) for z >= 0, unit scale.
double upper_tail(double dof, double z) {
  // Far out the square overflows or its ratio to dof is below rounding: leading term of the tail, in logs.
  if (z > 1e9 * std::max(1.0, std::sqrt(dof))) {
    return 0.5 * std::exp(0.5 * dof * (std::log(dof) - 2 * std::log(z)) - std::log(dof / 2) - log_beta_half(dof));
  }
  // In doubles, which keep twelve digits here; long doubles take five times as long.
  using InDouble = boost::math::policies::policy<boost::math::policies::promote_double<false>>;
  const double z2 = z * z;
  return dof > z2 ? 0.5 * boost::math::ibetac(0.5, dof / 2, z2 / (dof + z2), InDouble())
                  : 0.5 * boost::math::ibeta(dof / 2, 0.5, dof / (dof + z2), InDouble());
}

double standardised(const StudentT& t, double x) { return (x - t.location) / std::sqrt(t.scale2); }

// Doubles in ascending order as integers in ascending order, so that halving the range takes 64 steps at most.
uint64_t to_ordered(double x) {
  const auto bits = std::bit_cast<uint64_t>(x);
  return bits >> 63 ? ~bits : bits | (uint64_t(1) << 63);
}
double from_ordered(uint64_t i) { return std::bit_cast<double>(i >> 63 ? i & ~(uint64_t(1) << 63) : ~i); }

// Least x in [low, high] with at_least(x), given at_least(high).
template <class F>
double bisect(double low, double high, F at_least) {
  uint64_t below = to_ordered(low), above = to_ordered(high);
  if (at_least(low)) return low;
  while (above - below > 1) {
    const uint64_t middle = below + (above - below) / 2;
    (at_least(from_ordered(middle)) ? above : below) = middle;
  }
  return from_ordered(above);
}

// z >= 0 with P(T > z) = q, q <= 1/2; infinity beyond the largest double.
double upper_tail_inverse(double dof, double q) {
  if (upper_tail(dof, kLargest) > q) return std::numeric_limits<double>::infinity();
  return bisect(0, kLargest, [&](double z) { return upper_tail(dof, z) <= q; });
}

template <class F>
bool all_components(const StudentTMixture& m, F holds) {
  for (size_t c = 0; c < m.weight.size(); ++c)
    if (m.weight[c] > 0 && !holds(m.component[c])) return false;
  return true;
}

template <class F>
double average(const StudentTMixture& m, F f) {
  double sum = 0;
  for (size_t c = 0; c < m.weight.size(); ++c)
    if (m.weight[c] > 0) sum += m.weight[c] * f(m.component[c]);
  return sum;
}

// E[(psi - location) 1{psi beyond x}] towards the tail, dof > 1; tail chooses the side.
double tail_excess(const StudentT& t, double x, Tail tail) {
  const double z = standardised(t, x);
  const double size = pdf(t, x) * t.scale2 * (t.dof + z * z) / (t.dof - 1);
  return tail == Tail::upper ? size : -size;
}

double tail_mass(const StudentT& t, double x, Tail tail) {
  const double z = standardised(t, x) * (tail == Tail::upper ? 1 : -1);
  return z >= 0 ? upper_tail(t.dof, z) : 1 - upper_tail(t.dof, -z);
}

StudentTMixture single(const StudentT& t) { return {{1.0}, {t}}; }

}  // namespace

double log_pdf(const StudentT& t, double x) {
  const double half = t.dof / 2;
  const double spread2 = t.dof * t.scale2;
  const double d = x - t.location;
  return log_gamma_difference(half, 0.5) - 0.5 * std::log(std::numbers::pi * spread2) -
         (half + 0.5) * std::log1p(d * (d / spread2));
}

double pdf(const StudentT& t, double x) { return std::exp(log_pdf(t, x)); }

double log_pdf(const StudentTMixture& m, double x) {
  assert(m.weight.size() == m.component.size());
  double best = -std::numeric_limits<double>::infinity();
  for (size_t c = 0; c < m.weight.size(); ++c)
    if (m.weight[c] > 0) best = std::max(best, log_pdf(m.component[c], x));
  return best + std::log(average(m, [&](const StudentT& t) { return std::exp(log_pdf(t, x) - best); }));
}

double pdf(const StudentTMixture& m, double x) {
  return average(m, [&](const StudentT& t) { return pdf(t, x); });
}

double cdf(const StudentT& t, double x) { return tail_mass(t, x, Tail::lower); }

double cdf(const StudentTMixture& m, double x) {
  return average(m, [&](const StudentT& t) { return cdf(t, x); });
}

std::optional<double> quantile(const StudentT& t, double p) {
  if (!(p > 0 && p < 1)) return std::nullopt;
  const double z = upper_tail_inverse(t.dof, std::min(p, 1 - p));
  const double x = t.location + (p < 0.5 ? -z : z) * std::sqrt(t.scale2);
  return std::isfinite(x) ? std::optional(x) : std::nullopt;
}

std::optional<double> quantile(const StudentTMixture& m, double p) {
  if (!(p > 0 && p < 1)) return std::nullopt;
  double low = kLargest, high = -kLargest;
  for (size_t c = 0; c < m.weight.size(); ++c) {
    if (!(m.weight[c] > 0)) continue;
    const double q = quantile(m.component[c], p).value_or(p < 0.5 ? -kLargest : kLargest);
    low = std::min(low, q);
    high = std::max(high, q);
  }
  // A hair wider than the components' own quantiles, whose rounding must not shut the root out.
  const double slack = 1e-12 * std::max(std::abs(low), std::abs(high));
  low = std::max(low - slack, -kLargest);
  high = std::min(high + slack, kLargest);
  // In the upper half the complement keeps the digits that 1 - p still has.
  const auto reached = [&](double x) {
    if (p <= 0.5) return cdf(m, x) >= p;
    return average(m, [&](const StudentT& t) { return tail_mass(t, x, Tail::upper); }) <= 1 - p;
  };
  if (!reached(high) || (low == -kLargest && reached(low))) return std::nullopt;
  return bisect(low, high, reached);
}

std::optional<double> mean(const StudentT& t) { return mean(single(t)); }

std::optional<double> mean(const StudentTMixture& m) {
  if (!all_components(m, [](const StudentT& t) { return t.dof > 1; })) return std::nullopt;
  return location(m);
}

std::optional<double> variance(const StudentT& t) { return variance(single(t)); }

std::optional<double> variance(const StudentTMixture& m) {
  if (!all_components(m, [](const StudentT& t) { return t.dof > 2; })) return std::nullopt;
  const double centre = location(m);
  return average(m, [&](const StudentT& t) {
    const double d = t.location - centre;
    return t.scale2 * (t.dof / (t.dof - 2)) + d * d;
  });
}

std::optional<double> cvar(const StudentT& t, double p, Tail tail) { return cvar(single(t), p, tail); }

std::optional<double> cvar(const StudentTMixture& m, double p, Tail tail) {
  const std::optional<double> q = quantile(m, p);
  if (!q || !all_components(m, [](const StudentT& t) { return t.dof > 1; })) return std::nullopt;
  // About q, so that a location far from the origin does not cancel.
  const double mass = tail == Tail::upper ? 1 - p : p;
  return *q + average(m, [&](const StudentT& t) {
                return (t.location - *q) * tail_mass(t, *q, tail) + tail_excess(t, *q, tail);
              }) / mass;
}

double entropy(const StudentT& t) {
  const double half = t.dof / 2;
  return (half + 0.5) * digamma_difference(half, 0.5) + 0.5 * std::log(t.dof * t.scale2) + log_beta_half(t.dof);
}

double location(const StudentTMixture& m) {
  return average(m, [](const StudentT& t) { return t.location; });
}

}  // namespace felt
