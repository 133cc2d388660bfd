#include "inference/special_functions.h"

#include <boost/math/special_functions/digamma.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <boost/math/special_functions/trigamma.hpp>
#include <cmath>
#include <numbers>

namespace felt {
namespace {

// From here on the asymptotic series below are exact to double precision (first omitted term < 3e-18 of the value).
constexpr double kAsymptotic = 16.0;

// Up to this relative step two points of Gauss and Legendre integrate trigamma to double precision.
constexpr double kSmallStep = 3e-4;

// Bernoulli numbers B_2 .. B_16 give all three series.
constexpr double kB2 = 1.0 / 6, kB4 = -1.0 / 30, kB6 = 1.0 / 42, kB8 = -1.0 / 30, kB10 = 5.0 / 66, kB12 = -691.0 / 2730,
                 kB14 = 7.0 / 6;

// ln Gamma(x) - [(x - 1/2) ln x - x + ln(2 pi)/2]
double stirling_correction(double x) {
  const double y = 1 / (x * x);
  return (kB2 / 2 +
          y * (kB4 / 12 + y * (kB6 / 30 + y * (kB8 / 56 + y * (kB10 / 90 + y * (kB12 / 132 + y * kB14 / 182)))))) /
         x;
}

}  // namespace

double digamma(double x) { return boost::math::digamma(x); }

double trigamma(double x) { return boost::math::trigamma(x); }

double log_minus_digamma(double x) {
  if (x < kAsymptotic) return std::log(x) - boost::math::digamma(x);
  const double y = 1 / (x * x);
  return 0.5 / x +
         y * (kB2 / 2 +
              y * (kB4 / 4 + y * (kB6 / 6 + y * (kB8 / 8 + y * (kB10 / 10 + y * (kB12 / 12 + y * kB14 / 14))))));
}

double log_minus_digamma_slope(double x) {
  if (x < kAsymptotic) return x * (x * boost::math::trigamma(x) - 1);
  const double y = 1 / (x * x);
  return 0.5 + (kB2 + y * (kB4 + y * (kB6 + y * (kB8 + y * (kB10 + y * (kB12 + y * kB14)))))) / x;
}

double inverse_log_minus_digamma(double s) {
  // Start: the rational approximation of the Gamma maximum-likelihood shape, within 1.5 %, in the form that does not
  // cancel.
  const double root = std::sqrt((s - 3) * (s - 3) + 24 * s);
  double x = s > 3 ? 2 / (root + s - 3) : (3 - s + root) / (12 * s);
  // Newton in 1/x: D is nearly linear there, so that few steps reach rounding.
  for (int i = 0; i < 8; ++i) {
    const double step = (log_minus_digamma(x) - s) * x / log_minus_digamma_slope(x);  // relative step of 1/x, negated
    const double next = x / (1 - step);
    const bool done = std::abs(step) < 1e-15;
    x = next > 0 ? next : x / 2;
    if (done) break;
  }
  return x;
}

double digamma_difference(double x, double delta) {
  if (std::abs(delta) < kSmallStep * x) {
    const double middle = x + delta / 2, half = delta / 2 / std::numbers::sqrt3;
    return delta / 2 * (trigamma(middle - half) + trigamma(middle + half));
  }
  return std::log1p(delta / x) - (log_minus_digamma(x + delta) - log_minus_digamma(x));
}

double log_gamma_difference(double x, double delta) {
  if (x < kAsymptotic) return boost::math::lgamma(x + delta) - boost::math::lgamma(x);
  return (x - 0.5) * std::log1p(delta / x) + delta * (std::log(x + delta) - 1) + stirling_correction(x + delta) -
         stirling_correction(x);
}

}  // namespace felt
