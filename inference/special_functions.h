#pragma once

namespace felt {

/// digamma(x), x > 0.
double digamma(double x);

/// trigamma(x) = digamma'(x), x > 0.
double trigamma(double x);

/// D(x) = ln x - digamma(x), x > 0: positive, decreasing, 1/x for small x and 1/(2x) for large x. Relative error below
/// 1e-13 (never a difference of two large logarithms).
double log_minus_digamma(double x);

/// -x^2 D'(x) = x (x trigamma(x) - 1), x > 0: runs from 1 (x -> 0) to 1/2 (x -> infinity). The Newton step of the
/// inverse needs it without cancellation.
double log_minus_digamma_slope(double x);

/// The x > 0 with D(x) = s, for every finite s > 0. Relative error below 1e-12 for s from 1e-15 to 1e15.
double inverse_log_minus_digamma(double s);

/// digamma(x + delta) - digamma(x) for x > 0, x + delta > 0, without cancellation where delta is much below x.
double digamma_difference(double x, double delta);

/// ln Gamma(x + delta) - ln Gamma(x) for x > 0, delta >= 0, without cancellation where x is large.
double log_gamma_difference(double x, double delta);

}  // namespace felt
