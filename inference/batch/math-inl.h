// Special functions of the batch kernels on Highway vectors of f32. Included once per SIMD target; see
// inference/batch/functions.h for what each function is, its range and its error bound, and
// scripts/fit_batch_math.py for the coefficients.
#if defined(FELT_INFERENCE_BATCH_MATH_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_MATH_INL_H_
#undef FELT_INFERENCE_BATCH_MATH_INL_H_
#else
#define FELT_INFERENCE_BATCH_MATH_INL_H_
#endif

#include <hwy/highway.h>

#include "inference/batch/vector-inl.h"

#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {
using pair::M;
using pair::V;

HWY_INLINE V constant(float x) { return pair::Set(x); }
HWY_INLINE V clamp_to(V x, float least, float most) { return pair::Min(pair::Max(x, constant(least)), constant(most)); }

/// c[0] + c[1] x + ...: even and odd powers apart, which halves the chain of dependent operations.
template <size_t N>
HWY_INLINE V polynomial(V x, const float (&c)[N]) {
  const V x2 = pair::Mul(x, x);
  V even = constant(c[(N - 1) / 2 * 2]), odd = constant(c[N / 2 * 2 - 1]);
  for (int i = int(N - 1) / 2 * 2 - 2; i >= 0; i -= 2) even = pair::MulAdd(even, x2, constant(c[i]));
  for (int i = int(N / 2) * 2 - 3; i >= 1; i -= 2) odd = pair::MulAdd(odd, x2, constant(c[i]));
  return pair::MulAdd(odd, x, even);
}

/// u = 2^exponent (1 + f) with 1 + f in [sqrt(1/2), sqrt(2)), and tail = ln(1 + f) - f.
struct LogParts {
  V exponent_ln2, f, tail;
};

HWY_INLINE LogParts log_parts(V u, V u_minus_1) {
  const pair::Binary binary = pair::SplitBinary(u);
  // Where no power of two was taken out, u - 1 is known better than from the rounded u.
  const V f =
      pair::IfThenElse(pair::Eq(binary.exponent, pair::Zero()), u_minus_1, pair::Sub(binary.mantissa, constant(1.0f)));
  constexpr float kTail[] = {-0.4999999998f, 0.3333332265f,  -0.2500000008f, 0.2000145377f,  -0.1666811656f,
                             0.1423261611f,  -0.1241073326f, 0.1179987461f,  -0.1161299507f, 0.0686429154f};
  return {pair::Mul(binary.exponent, constant(0.693147182f)), f, pair::Mul(pair::Mul(f, f), polynomial(f, kTail))};
}

HWY_INLINE V log_of(V x) {
  const LogParts p = log_parts(x, pair::Sub(x, constant(1.0f)));
  return pair::Add(p.exponent_ln2, pair::Add(p.f, p.tail));
}

struct Log1p {
  V log;          ///< ln(1 + x)
  V log_minus_x;  ///< ln(1 + x) - x
};

/// `u` = 1 + x, known better than that sum where x is close to -1.
HWY_INLINE Log1p log1p_of(V x, V u) {
  const LogParts p = log_parts(u, x);
  return {pair::Add(p.exponent_ln2, pair::Add(p.f, p.tail)),
          pair::Add(p.tail, pair::Add(pair::Sub(p.f, x), p.exponent_ln2))};
}
HWY_INLINE Log1p log1p_of(V x) { return log1p_of(x, pair::Add(constant(1.0f), x)); }

/// exp(x) for x <= 0; 0 below -80 (denormal floats are slow, and no responsibility so small can matter).
HWY_INLINE V exp_of_negative(V x) {
  const M negligible = pair::Lt(x, constant(-80.0f));
  x = pair::Max(x, constant(-80.0f));
  const V n = pair::Round(pair::Mul(x, constant(1.442695041f)));
  const V f = pair::NegMulAdd(n, constant(-2.12194440e-4f), pair::NegMulAdd(n, constant(0.693359375f), x));
  constexpr float kExp[] = {1.0f,      1.0f,       0.5f,       1.0f / 6,
                            1.0f / 24, 1.0f / 120, 1.0f / 720, 1.0f / 5040};  // |f| <= ln(2)/2
  return pair::IfThenZeroElse(negligible, pair::Mul(polynomial(f, kExp), pair::PowerOfTwo(n)));
}

/// 1/x and 1/(1 + x) from one division.
struct Reciprocals {
  V of_x, of_x_plus_1;
};

HWY_INLINE Reciprocals reciprocals(V x) {
  const V x1 = pair::Add(x, constant(1.0f));
  const V both = pair::Div(constant(1.0f), pair::Mul(x, x1));
  return {pair::Mul(x1, both), pair::Mul(x, both)};
}

/// D(1 + x) = ln(1 + x) - digamma(1 + x), t = 1/(1 + x): t/2 + t^2/12 - t^4 P(t^2).
HWY_INLINE V shifted_log_minus_digamma(V t) {
  constexpr float kTail[] = {0.008315632927f, -0.00369842016f, 0.002524320814f, -0.001383067387f, 0.0003593073165f};
  const V t2 = pair::Mul(t, t);
  const V tail = pair::NegMulAdd(t2, polynomial(t2, kTail), constant(1.0f / 12));
  return pair::Mul(t, pair::MulAdd(t, tail, constant(0.5f)));
}

/// D(x) = ln x - digamma(x): by digamma(x) = digamma(1 + x) - 1/x, a sum of two positive terms.
HWY_INLINE V log_minus_digamma_of(Reciprocals of) {
  return pair::Sub(shifted_log_minus_digamma(of.of_x_plus_1), log1p_of(of.of_x).log_minus_x);
}

/// D(x) for x >= 1 without a logarithm: inv_x = 1/x, t = 1/(x + 1/2).
HWY_INLINE V log_minus_digamma_from_1(V inv_x, V t) {
  constexpr float kTimesX[] = {0.4999999899f,    0.08333485523f,    0.04162951889f, 0.01283327171f,
                               -0.003436304799f, -0.0009508899741f, 0.001807163178f};
  return pair::Mul(inv_x, polynomial(t, kTimesX));
}

/// digamma(x + 1/2) - digamma(x) - 1/(2x) for x >= 1; arguments as above. Accurate relative to D(x).
HWY_INLINE V digamma_half_step_from_1(V inv_x, V t) {
  constexpr float kStep[] = {0.1250098996f, 0.06226047803f, 0.01752418152f, -0.01448701287f, 0.002760463249f};
  return pair::Mul(pair::Mul(inv_x, t), polynomial(t, kStep));
}

/// x with D(x) = s for 0 < s <= kMostSmallD, that is x >= 1.
constexpr float kMostSmallD = 0.577215f;
HWY_INLINE V inverse_log_minus_digamma_from_1(V s) {
  constexpr float kTimesS[] = {0.5000000284f,  0.1666596841f,   -0.05527446482f, -0.0339360106f,
                               0.09017118863f, -0.07931524212f, 0.02790685356f};
  return pair::Div(polynomial(s, kTimesS), s);
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
  const V t2 = pair::Mul(t, t);
  return pair::Mul(t, pair::NegMulAdd(t2, polynomial(t2, kTail), constant(1.0f / 12)));
}

/// lgamma(x + h) - lgamma(x) - h ln(1 + x + h), h >= 0: the part that does not depend on how large x + h is.
HWY_INLINE V log_gamma_difference_less_log(V x, V h) {
  const Reciprocals of = reciprocals(x);
  const V one = constant(1.0f), half = constant(0.5f);
  const V x1 = pair::Add(x, one);
  const Log1p step = log1p_of(pair::Mul(h, of.of_x_plus_1));
  const V later = pair::Div(one, pair::Add(x1, h));
  const V remainders = pair::Sub(stirling_remainder(later), stirling_remainder(of.of_x_plus_1));
  const V shifted = pair::MulAdd(x1, step.log_minus_x, pair::NegMulAdd(half, step.log, remainders));
  // Gamma(x) = Gamma(1 + x)/x
  return pair::Sub(shifted, log1p_of(pair::Mul(h, of.of_x)).log);
}

/// x > 0 with D(x) = s. `near` is a guess and `d_near` = D(near): used where it is close, so that a guess that is
/// already right comes back unchanged.
HWY_INLINE V inverse_log_minus_digamma_of(V s, V near, V d_near) {
  const V one = constant(1.0f);
  const V inv_s = pair::Div(one, s);
  // Minka's closed form, within 1.5 % everywhere; written without cancellation on either side of s = 3.
  const V p = pair::Sub(s, constant(3.0f));
  const V root = pair::Sqrt(pair::MulAdd(s, pair::Add(s, constant(18.0f)), constant(9.0f)));
  const V sum = pair::Add(root, pair::Abs(p));
  const M large = pair::Ge(p, pair::Zero());
  const V closed = pair::Mul(pair::Div(pair::IfThenElse(large, constant(2.0f), sum), pair::IfThenElse(large, sum, s)),
                             pair::IfThenElse(large, one, constant(1.0f / 12)));
  const V miss = pair::Mul(pair::Sub(d_near, s), inv_s);
  const V x = pair::IfThenElse(pair::Lt(pair::Abs(miss), constant(0.01f)), near, closed);
  // One step in logarithms, where D is almost a power law of exponent -c/(x D); second order in the relative miss.
  const Reciprocals of = reciprocals(x);
  const V d = log_minus_digamma_of(of);
  const V relative = pair::Mul(pair::Sub(d, s), inv_s);
  const V exponent = pair::Div(pair::Mul(x, d), trigamma_excess(of.of_x_plus_1));
  const V second = pair::MulAdd(pair::Mul(constant(0.5f), pair::Sub(exponent, one)), relative, one);
  return pair::MulAdd(pair::Mul(x, relative), pair::Mul(exponent, second), x);
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
