#pragma once

#include <span>

/// The functions of inference/batch/functions.h in f64, rounded once: their specification.
namespace felt::scalar {

void batch_log(std::span<const float> x, std::span<float> out) noexcept;
void batch_log1p(std::span<const float> x, std::span<float> out) noexcept;
void batch_exp_of_negative(std::span<const float> x, std::span<float> out) noexcept;
void batch_digamma(std::span<const float> x, std::span<float> out) noexcept;
void batch_trigamma(std::span<const float> x, std::span<float> out) noexcept;
void batch_log_minus_digamma(std::span<const float> x, std::span<float> out) noexcept;
void batch_digamma_half_step(std::span<const float> x, std::span<float> out) noexcept;
void batch_inverse_log_minus_digamma(std::span<const float> s, std::span<float> out) noexcept;
void batch_log_gamma_half_step(std::span<const float> x, std::span<float> out) noexcept;
void batch_log_gamma_difference(std::span<const float> x, std::span<const float> h, std::span<float> out) noexcept;

}  // namespace felt::scalar
