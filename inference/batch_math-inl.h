// Special functions of the batch kernels on Highway vectors of f32. Included once per SIMD target; see
// inference/batch_functions.h for what each function is, its range and its error bound, and
// scripts/fit_batch_math.py for the coefficients.
#if defined(FELT_INFERENCE_BATCH_MATH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_MATH_INL_H_
#undef FELT_INFERENCE_BATCH_MATH_INL_H_
#else
#define FELT_INFERENCE_BATCH_MATH_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = hn::ScalableTag<float>;
using V = hn::Vec<F>;
using M = hn::Mask<F>;

HWY_INLINE V constant(float x) { return hn::Set(F(), x); }

/// c[0] + c[1] x + ...: even and odd powers apart, which halves the chain of dependent operations.
template <size_t N>
HWY_INLINE V polynomial(V x, const float (&c)[N]) {
  const V x2 = hn::Mul(x, x);
  V even = constant(c[(N - 1) / 2 * 2]), odd = constant(c[N / 2 * 2 - 1]);
  for (int i = int(N - 1) / 2 * 2 - 2; i >= 0; i -= 2) even = hn::MulAdd(even, x2, constant(c[i]));
  for (int i = int(N / 2) * 2 - 3; i >= 1; i -= 2) odd = hn::MulAdd(odd, x2, constant(c[i]));
  return hn::MulAdd(odd, x, even);
}

/// u = 2^exponent (1 + f) with 1 + f in [sqrt(1/2), sqrt(2)), and tail = ln(1 + f) - f.
struct LogParts {
  V exponent_ln2, f, tail;
};

HWY_INLINE LogParts log_parts(V u, V u_minus_1) {
  const hn::RebindToSigned<F> di;
  const auto bits = hn::BitCast(di, u);
  const auto e = hn::ShiftRight<23>(hn::Sub(bits, hn::Set(di, 0x3F3504F3)));  // of sqrt(1/2)
  const V mantissa = hn::BitCast(F(), hn::Sub(bits, hn::ShiftLeft<23>(e)));
  // Where no power of two was taken out, u - 1 is known better than from the rounded u.
  const M as_is = hn::RebindMask(F(), hn::Eq(e, hn::Zero(di)));
  const V f = hn::IfThenElse(as_is, u_minus_1, hn::Sub(mantissa, constant(1.0f)));
  constexpr float kTail[] = {-0.4999999998f, 0.3333332265f,  -0.2500000008f, 0.2000145377f,  -0.1666811656f,
                             0.1423261611f,  -0.1241073326f, 0.1179987461f,  -0.1161299507f, 0.0686429154f};
  return {hn::Mul(hn::ConvertTo(F(), e), constant(0.693147182f)), f, hn::Mul(hn::Mul(f, f), polynomial(f, kTail))};
}

HWY_INLINE V log_of(V x) {
  const LogParts p = log_parts(x, hn::Sub(x, constant(1.0f)));
  return hn::Add(p.exponent_ln2, hn::Add(p.f, p.tail));
}

struct Log1p {
  V log;          ///< ln(1 + x)
  V log_minus_x;  ///< ln(1 + x) - x
};

/// `u` = 1 + x, known better than that sum where x is close to -1.
HWY_INLINE Log1p log1p_of(V x, V u) {
  const LogParts p = log_parts(u, x);
  return {hn::Add(p.exponent_ln2, hn::Add(p.f, p.tail)), hn::Add(p.tail, hn::Add(hn::Sub(p.f, x), p.exponent_ln2))};
}
HWY_INLINE Log1p log1p_of(V x) { return log1p_of(x, hn::Add(constant(1.0f), x)); }

/// exp(x) for x <= 0; 0 below -80 (denormal floats are slow, and no responsibility so small can matter).
HWY_INLINE V exp_of_negative(V x) {
  const hn::RebindToSigned<F> di;
  const M negligible = hn::Lt(x, constant(-80.0f));
  x = hn::Max(x, constant(-80.0f));
  const V n = hn::Round(hn::Mul(x, constant(1.442695041f)));
  const V f = hn::NegMulAdd(n, constant(-2.12194440e-4f), hn::NegMulAdd(n, constant(0.693359375f), x));
  constexpr float kExp[] = {1.0f,      1.0f,       0.5f,       1.0f / 6,
                            1.0f / 24, 1.0f / 120, 1.0f / 720, 1.0f / 5040};  // |f| <= ln(2)/2
  const auto scale = hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(di, n), hn::Set(di, 127)));
  return hn::IfThenZeroElse(negligible, hn::Mul(polynomial(f, kExp), hn::BitCast(F(), scale)));
}

/// 1/x and 1/(1 + x) from one division.
struct Reciprocals {
  V of_x, of_x_plus_1;
};

HWY_INLINE Reciprocals reciprocals(V x) {
  const V x1 = hn::Add(x, constant(1.0f));
  const V both = hn::Div(constant(1.0f), hn::Mul(x, x1));
  return {hn::Mul(x1, both), hn::Mul(x, both)};
}

/// D(1 + x) = ln(1 + x) - digamma(1 + x), t = 1/(1 + x): t/2 + t^2/12 - t^4 P(t^2).
HWY_INLINE V shifted_log_minus_digamma(V t) {
  constexpr float kTail[] = {0.008315632927f, -0.00369842016f, 0.002524320814f, -0.001383067387f, 0.0003593073165f};
  const V t2 = hn::Mul(t, t);
  const V tail = hn::NegMulAdd(t2, polynomial(t2, kTail), constant(1.0f / 12));
  return hn::Mul(t, hn::MulAdd(t, tail, constant(0.5f)));
}

/// D(x) = ln x - digamma(x): by digamma(x) = digamma(1 + x) - 1/x, a sum of two positive terms.
HWY_INLINE V log_minus_digamma_of(Reciprocals of) {
  return hn::Sub(shifted_log_minus_digamma(of.of_x_plus_1), log1p_of(of.of_x).log_minus_x);
}

/// c(x) = x^2 trigamma(x) - x = -x^2 D'(x), t = 1/(1 + x).
HWY_INLINE V trigamma_excess(V t) {
  constexpr float kExcess[] = {0.5000001825f,  0.1666392851f,   0.1673352338f,  0.1271631115f,
                               0.09422651441f, -0.07326391579f, 0.01864861187f, -0.00074865844f};
  return polynomial(t, kExcess);
}

/// w(x) = (Gamma(x + 1)/Gamma(x + 1/2))^2 - x, so that lgamma(x + 1/2) - lgamma(x) = ln(x^2/(x + w))/2; t = 1/(1 + x).
HWY_INLINE V half_step_excess(V t) {
  constexpr float kExcess[] = {0.249983974f, 0.03152641492f, 0.02181042363f, 0.01764239458f, -0.002653224499f};
  return polynomial(t, kExcess);
}

/// lgamma(x) - [(x - 1/2) ln x - x + ln(2 pi)/2] for x = 1/t >= 1.
HWY_INLINE V stirling_remainder(V t) {
  constexpr float kTail[] = {0.002770749794f, -0.0007206540763f, 0.0002966791194f, -7.497453788e-5f};
  const V t2 = hn::Mul(t, t);
  return hn::Mul(t, hn::NegMulAdd(t2, polynomial(t2, kTail), constant(1.0f / 12)));
}

/// lgamma(x + h) - lgamma(x) - h ln(1 + x + h), h >= 0: the part that does not depend on how large x + h is.
HWY_INLINE V log_gamma_difference_less_log(V x, V h) {
  const Reciprocals of = reciprocals(x);
  const V one = constant(1.0f), half = constant(0.5f);
  const V x1 = hn::Add(x, one);
  const Log1p step = log1p_of(hn::Mul(h, of.of_x_plus_1));
  const V later = hn::Div(one, hn::Add(x1, h));
  const V remainders = hn::Sub(stirling_remainder(later), stirling_remainder(of.of_x_plus_1));
  const V shifted = hn::MulAdd(x1, step.log_minus_x, hn::NegMulAdd(half, step.log, remainders));
  // Gamma(x) = Gamma(1 + x)/x
  return hn::Sub(shifted, log1p_of(hn::Mul(h, of.of_x)).log);
}

/// x > 0 with D(x) = s. `near` is a guess and `d_near` = D(near): used where it is close, so that a guess that is
/// already right comes back unchanged.
HWY_INLINE V inverse_log_minus_digamma_of(V s, V near, V d_near) {
  const V one = constant(1.0f);
  const V inv_s = hn::Div(one, s);
  // Minka's closed form, within 1.5 % everywhere; written without cancellation on either side of s = 3.
  const V p = hn::Sub(s, constant(3.0f));
  const V root = hn::Sqrt(hn::MulAdd(s, hn::Add(s, constant(18.0f)), constant(9.0f)));
  const V sum = hn::Add(root, hn::Abs(p));
  const M large = hn::Ge(p, hn::Zero(F()));
  const V closed = hn::Mul(hn::Div(hn::IfThenElse(large, constant(2.0f), sum), hn::IfThenElse(large, sum, s)),
                           hn::IfThenElse(large, one, constant(1.0f / 12)));
  const V miss = hn::Mul(hn::Sub(d_near, s), inv_s);
  const V x = hn::IfThenElse(hn::Lt(hn::Abs(miss), constant(0.01f)), near, closed);
  // One step in logarithms, where D is almost a power law of exponent -c/(x D); second order in the relative miss.
  const Reciprocals of = reciprocals(x);
  const V d = log_minus_digamma_of(of);
  const V relative = hn::Mul(hn::Sub(d, s), inv_s);
  const V exponent = hn::Div(hn::Mul(x, d), trigamma_excess(of.of_x_plus_1));
  const V second = hn::MulAdd(hn::Mul(constant(0.5f), hn::Sub(exponent, one)), relative, one);
  return hn::MulAdd(hn::Mul(x, relative), hn::Mul(exponent, second), x);
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
