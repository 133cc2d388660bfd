#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "inference/batch/functions_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>

#include "core/simd.h"
#include "inference/batch/functions.h"
#include "inference/batch/functions_kernels.h"
#include "inference/batch/math-inl.h"
#include "inference/batch/projection-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

/// out[i] = f(x[i], y[i]); the last vector is padded with ones.
template <class Function>
HWY_INLINE void map(const float* x, const float* y, size_t n, float* out, Function f) {
  const size_t lanes = pair::lanes();
  size_t i = 0;
  for (; i + lanes <= n; i += lanes) pair::StoreU(f(pair::LoadU(x + i), pair::LoadU(y + i)), out + i);
  if (i == n) return;
  float padded_x[2 * HWY_MAX_BYTES / sizeof(float)], padded_y[2 * HWY_MAX_BYTES / sizeof(float)];
  std::fill_n(padded_x, lanes, 1.0f);
  std::fill_n(padded_y, lanes, 1.0f);
  std::copy(x + i, x + n, padded_x);
  std::copy(y + i, y + n, padded_y);
  pair::StoreU(f(pair::LoadU(padded_x), pair::LoadU(padded_y)), padded_x);
  std::copy_n(padded_x, n - i, out + i);
}

HWY_INLINE V trigamma_of(V x) {
  const V t = reciprocals(x).of_x_plus_1;
  const V inverse = pair::Div(constant(1.0f), x);
  return pair::Mul(inverse, pair::MulAdd(trigamma_excess(t), inverse, constant(1.0f)));
}

HWY_INLINE V log_gamma_half_step_of(V x) {
  const V w = half_step_excess(reciprocals(x).of_x_plus_1);
  // ln x + ln(x/(x + w)), each within the range of f32 where x^2 is not.
  return pair::Mul(constant(0.5f), pair::Add(log_of(x), log_of(pair::Div(x, pair::Add(x, w)))));
}

/// As the projection computes them: without logarithms from x = 1 on.
HWY_INLINE ShapeTerms shape_terms_of(V x) {
  const V inverse = pair::Div(constant(1.0f), x), zero = pair::Zero();
  const V half = constant(0.5f);
  return half_step_shape_terms(x, inverse, {half, pair::Mul(half, inverse), zero, zero, zero, zero, zero});
}

HWY_INLINE V digamma_of(V x) { return pair::Sub(log_of(x), log_minus_digamma_of(reciprocals(x))); }

HWY_INLINE V digamma_half_step_of(V x) {
  return pair::Add(shape_terms_of(x).step_excess, pair::Div(constant(0.5f), x));
}

HWY_INLINE V inverse_of(V s) { return shape_of(s, constant(1.0f), constant(0.577215665f)); }

HWY_INLINE V log_gamma_difference_of(V x, V h) {
  const V end = pair::Add(constant(1.0f), pair::Add(x, h));
  return pair::MulAdd(h, log_of(end), log_gamma_difference_less_log(x, h));
}

void LogArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return log_of(v); });
}
void Log1pArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return log1p_of(v).log; });
}
void ExpOfNegativeArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return exp_of_negative(v); });
}
void DigammaArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return digamma_of(v); });
}
void TrigammaArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return trigamma_of(v); });
}
void LogMinusDigammaArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return shape_terms_of(v).d; });
}
void InverseArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return inverse_of(v); });
}
void DigammaHalfStepArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return digamma_half_step_of(v); });
}
void HalfStepArray(const float* x, const float* y, size_t n, float* out) {
  map(x, y, n, out, [](V v, V) HWY_ATTR { return log_gamma_half_step_of(v); });
}
void LogGammaDifferenceArray(const float* x, const float* h, size_t n, float* out) {
  map(x, h, n, out, [](V v, V w) HWY_ATTR { return log_gamma_difference_of(v, w); });
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {
HWY_EXPORT(LogArray);
HWY_EXPORT(Log1pArray);
HWY_EXPORT(ExpOfNegativeArray);
HWY_EXPORT(DigammaArray);
HWY_EXPORT(TrigammaArray);
HWY_EXPORT(LogMinusDigammaArray);
HWY_EXPORT(InverseArray);
HWY_EXPORT(DigammaHalfStepArray);
HWY_EXPORT(HalfStepArray);
HWY_EXPORT(LogGammaDifferenceArray);

#define FELT_BATCH_FUNCTION(name, Kernel)                                   \
  void name(std::span<const float> x, std::span<float> out) noexcept {      \
    if (simd_scalar_forced()) return scalar::name(x, out);                  \
    HWY_DYNAMIC_DISPATCH(Kernel)(x.data(), x.data(), x.size(), out.data()); \
  }

FELT_BATCH_FUNCTION(batch_log, LogArray)
FELT_BATCH_FUNCTION(batch_log1p, Log1pArray)
FELT_BATCH_FUNCTION(batch_exp_of_negative, ExpOfNegativeArray)
FELT_BATCH_FUNCTION(batch_digamma, DigammaArray)
FELT_BATCH_FUNCTION(batch_trigamma, TrigammaArray)
FELT_BATCH_FUNCTION(batch_log_minus_digamma, LogMinusDigammaArray)
FELT_BATCH_FUNCTION(batch_inverse_log_minus_digamma, InverseArray)
FELT_BATCH_FUNCTION(batch_digamma_half_step, DigammaHalfStepArray)
FELT_BATCH_FUNCTION(batch_log_gamma_half_step, HalfStepArray)
#undef FELT_BATCH_FUNCTION

void batch_log_gamma_difference(std::span<const float> x, std::span<const float> h, std::span<float> out) noexcept {
  if (simd_scalar_forced()) return scalar::batch_log_gamma_difference(x, h, out);
  HWY_DYNAMIC_DISPATCH(LogGammaDifferenceArray)(x.data(), h.data(), x.size(), out.data());
}

}  // namespace felt
#endif
