#include "inference/batch/functions_kernels.h"

#include <algorithm>
#include <cmath>

#include "inference/special_functions.h"

namespace felt::scalar {
namespace {

template <class Function>
void map(std::span<const float> x, std::span<float> out, Function f) noexcept {
  std::transform(x.begin(), x.end(), out.begin(), [&](float v) { return float(f(double(v))); });
}

}  // namespace

void batch_log(std::span<const float> x, std::span<float> out) noexcept {
  map(x, out, [](double v) { return std::log(v); });
}

void batch_log1p(std::span<const float> x, std::span<float> out) noexcept {
  map(x, out, [](double v) { return std::log1p(v); });
}

void batch_exp_of_negative(std::span<const float> x, std::span<float> out) noexcept {
  map(x, out, [](double v) { return v < -80 ? 0 : std::exp(v); });
}

void batch_digamma(std::span<const float> x, std::span<float> out) noexcept { map(x, out, digamma); }

void batch_trigamma(std::span<const float> x, std::span<float> out) noexcept { map(x, out, trigamma); }

void batch_log_minus_digamma(std::span<const float> x, std::span<float> out) noexcept {
  map(x, out, log_minus_digamma);
}

void batch_digamma_half_step(std::span<const float> x, std::span<float> out) noexcept {
  map(x, out, [](double v) { return digamma_difference(v, 0.5); });
}

void batch_inverse_log_minus_digamma(std::span<const float> s, std::span<float> out) noexcept {
  map(s, out, inverse_log_minus_digamma);
}

void batch_log_gamma_half_step(std::span<const float> x, std::span<float> out) noexcept {
  map(x, out, [](double v) { return log_gamma_difference(v, 0.5); });
}

void batch_log_gamma_difference(std::span<const float> x, std::span<const float> h, std::span<float> out) noexcept {
  std::transform(x.begin(), x.end(), h.begin(), out.begin(),
                 [](float v, float w) { return float(log_gamma_difference(double(v), double(w))); });
}

}  // namespace felt::scalar
