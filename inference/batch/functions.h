#pragma once

#include <span>

namespace felt {

/// The special functions of the batch kernels in f32, many values at a time (SIMD; "scalar" computes in f64 and
/// rounds). Spans of one length; `out` may alias an input. Arguments from 1e-15 to 1e15 unless told otherwise. The
/// bounds hold on every SIMD target (tests/unit/inference/batch_functions_test.cpp compares against Boost.Math over all
/// binary exponents).

/// ln x for x from 1e-37 to 1e37: error below 2e-7 max(1, |ln x|).
void batch_log(std::span<const float> x, std::span<float> out) noexcept;
/// ln(1 + x) for x > -1: relative error below 4e-7.
void batch_log1p(std::span<const float> x, std::span<float> out) noexcept;
/// exp(x) for x <= 0: relative error below 3e-7; 0 below x = -80.
void batch_exp_of_negative(std::span<const float> x, std::span<float> out) noexcept;
/// digamma(x): error below 1e-6 max(1, |digamma(x)|).
void batch_digamma(std::span<const float> x, std::span<float> out) noexcept;
/// trigamma(x): relative error below 1e-6.
void batch_trigamma(std::span<const float> x, std::span<float> out) noexcept;
/// D(x) = ln x - digamma(x): relative error below 1e-6.
void batch_log_minus_digamma(std::span<const float> x, std::span<float> out) noexcept;
/// digamma(x + 1/2) - digamma(x): relative error below 1e-6.
void batch_digamma_half_step(std::span<const float> x, std::span<float> out) noexcept;
/// x with D(x) = s: relative error below 1e-6 for s <= D(1), below 1e-5 elsewhere.
void batch_inverse_log_minus_digamma(std::span<const float> s, std::span<float> out) noexcept;
/// lgamma(x + 1/2) - lgamma(x): error below 1e-6 max(1, |value|).
void batch_log_gamma_half_step(std::span<const float> x, std::span<float> out) noexcept;
/// lgamma(x + h) - lgamma(x), h from 0 to 1e6: error below 1e-6 max(1, |value|, h ln(1 + x + h)).
void batch_log_gamma_difference(std::span<const float> x, std::span<const float> h, std::span<float> out) noexcept;

}  // namespace felt
