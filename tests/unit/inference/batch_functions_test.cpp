#include "inference/batch/functions.h"

#include <algorithm>
#include <boost/math/special_functions/digamma.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <boost/math/special_functions/trigamma.hpp>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <vector>

#include "tests/support/simd_targets.h"

using namespace felt;

namespace {

/// Every binary exponent between the limits, `per_octave` mantissas in each (not aligned with any reduction's limits).
std::vector<float> octaves(double lo, double hi, int per_octave) {
  std::vector<float> x;
  for (int e = std::ilogb(lo); e <= std::ilogb(hi); ++e) {
    for (int m = 0; m < per_octave; ++m) {
      const double v = std::ldexp(1 + (m + 0.371) / per_octave, e);
      if (v >= lo && v <= hi) x.push_back(float(v));
    }
  }
  return x;
}

using Batch = void (*)(std::span<const float>, std::span<float>) noexcept;
using Exact = std::function<double(double)>;
using Tolerance = std::function<double(double exact)>;

double worst(Batch batch, const std::vector<float>& x, const std::vector<double>& exact, const Tolerance& unit) {
  std::vector<float> out(x.size());
  batch(x, out);
  double largest = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    const double error = std::abs(double(out[i]) - exact[i]) / unit(exact[i]);
    largest = std::max(largest, std::isfinite(error) ? error : INFINITY);
  }
  return largest;
}

void check_everywhere(Batch batch, const std::vector<float>& x, const Exact& f, const Tolerance& unit, double bound) {
  std::vector<double> exact(x.size());
  for (size_t i = 0; i < x.size(); ++i) exact[i] = f(double(x[i]));
  test::on_every_simd_target([&](const std::string& target) {
    INFO(target);
    CHECK(worst(batch, x, exact, unit) < bound);
  });
}

double relative(double exact) { return std::abs(exact); }
double relative_or_absolute(double exact) { return std::max(1.0, std::abs(exact)); }

double log_minus_digamma_boost(double x) {
  // Above 30 the difference of logarithms cancels: D(x) = 1/(2x) + 1/(12 x^2) - 1/(120 x^4) + ...
  if (x > 30) return 1 / (2 * x) + 1 / (12 * x * x) * (1 - 1 / (10 * x * x) * (1 - 10 / (21 * x * x)));
  return std::log(x) - boost::math::digamma(x);
}

double digamma_half_step_boost(double x) {
  // Far out the difference cancels: 1/(2x) + 1/(8 x^2) - 1/(64 x^4) + ...
  if (x > 1000) return 1 / (2 * x) + 1 / (8 * x * x) * (1 - 1 / (8 * x * x));
  return boost::math::digamma(x + 0.5) - boost::math::digamma(x);
}

}  // namespace

TEST_CASE("f32 logarithms and exponentials keep their bounds over all exponents on every SIMD target") {
  check_everywhere(
      batch_log, octaves(1e-37, 1e37, 3001), [](double x) { return std::log(x); }, relative_or_absolute, 2e-7);
  check_everywhere(
      batch_log1p, octaves(1e-30, 1e30, 3001), [](double x) { return std::log1p(x); }, relative, 4e-7);
  std::vector<float> negative = octaves(1e-30, 0.9999, 3001);
  for (float& x : negative) x = -x;
  check_everywhere(
      batch_log1p, negative, [](double x) { return std::log1p(x); }, relative, 4e-7);
  std::vector<float> exponents = octaves(1e-10, 80, 5001);
  for (float& x : exponents) x = -x;
  check_everywhere(
      batch_exp_of_negative, exponents, [](double x) { return std::exp(x); }, relative, 3e-7);
  const float far[] = {0.0f, -81.0f, -1e30f};
  float out[3];
  batch_exp_of_negative(far, out);
  CHECK(out[0] == 1.0f);
  CHECK(out[1] == 0.0f);
  CHECK(out[2] == 0.0f);
}

TEST_CASE("f32 digamma family keeps its bounds over all exponents on every SIMD target") {
  const std::vector<float> x = octaves(1e-15, 1e15, 1009);
  check_everywhere(batch_log_minus_digamma, x, log_minus_digamma_boost, relative, 1e-6);
  check_everywhere(
      batch_digamma, x, [](double v) { return boost::math::digamma(v); }, relative_or_absolute, 1e-6);
  check_everywhere(batch_digamma_half_step, x, digamma_half_step_boost, relative, 1e-6);
  check_everywhere(
      batch_trigamma, x, [](double v) { return boost::math::trigamma(v); }, relative, 1e-6);
}

TEST_CASE("the f32 inverse of ln x - digamma(x) finds x within 1e-5 on every SIMD target") {
  // Backwards: s = D(x) in double, rounded once; the rounding moves x by less than 1e-7.
  const std::vector<float> x = octaves(1e-12, 1e12, 1009);
  std::vector<float> s(x.size());
  std::vector<double> exact(x.begin(), x.end());
  for (size_t i = 0; i < x.size(); ++i) s[i] = float(log_minus_digamma_boost(double(x[i])));
  test::on_every_simd_target([&](const std::string& target) {
    INFO(target);
    CHECK(worst(batch_inverse_log_minus_digamma, s, exact, relative) < 1e-5);
    const auto from_1 = std::lower_bound(x.begin(), x.end(), 1.001f) - x.begin();
    const std::vector<float> small_s(s.begin() + from_1, s.end());
    const std::vector<double> large_x(exact.begin() + from_1, exact.end());
    CHECK(worst(batch_inverse_log_minus_digamma, small_s, large_x, relative) < 1e-6);
  });
}

TEST_CASE("f32 differences of lgamma keep their bounds on every SIMD target") {
  const std::vector<float> x = octaves(1e-12, 1e6, 1009);
  check_everywhere(
      batch_log_gamma_half_step, x, [](double v) { return boost::math::lgamma(v + 0.5) - boost::math::lgamma(v); },
      relative_or_absolute, 1e-6);
  for (const float h : {0.0f, 0.5f, 1.0f, 2.5f, 10.0f, 333.5f, 1e5f}) {
    INFO("h = " << h);
    const std::vector<float> steps(x.size(), h);
    std::vector<float> out(x.size());
    test::on_every_simd_target([&](const std::string& target) {
      INFO(target);
      batch_log_gamma_difference(x, steps, out);
      double largest = 0;
      for (size_t i = 0; i < x.size(); ++i) {
        const double v = double(x[i]);
        const double exact = boost::math::lgamma(v + double(h)) - boost::math::lgamma(v);
        largest = std::max(largest, std::abs(double(out[i]) - exact) /
                                        std::max(relative_or_absolute(exact), double(h) * std::log1p(v + double(h))));
      }
      CHECK(largest < 1e-6);
    });
  }
}

TEST_CASE("batches of any length leave what lies behind them alone") {
  for (size_t n = 0; n < 40; ++n) {
    std::vector<float> x(n, 2.5f), out(n + 8, -7.0f);
    batch_digamma(x, std::span(out).first(n));
    for (size_t i = 0; i < n; ++i) REQUIRE(out[i] == Approx(boost::math::digamma(2.5)).epsilon(1e-6));
    for (size_t i = n; i < out.size(); ++i) REQUIRE(out[i] == -7.0f);
  }
}
