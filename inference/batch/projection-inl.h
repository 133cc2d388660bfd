// Projection of r NIG~ + (1 - r) NIG to one NIG on Highway vectors, shared by the batch kernels. Included once per SIMD
// target. inference/projection.h is the specification, docs/batch_kernels.md has the forms used here.
#if defined(FELT_INFERENCE_BATCH_PROJECTION_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_PROJECTION_INL_H_
#undef FELT_INFERENCE_BATCH_PROJECTION_INL_H_
#else
#define FELT_INFERENCE_BATCH_PROJECTION_INL_H_
#endif

#include <hwy/highway.h>

#include "inference/batch/limits.h"
#include "inference/batch/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

struct NigVectors {
  V tau, kappa, beta, gamma;
};

/// The update of one class in relative terms, so that nothing depends on where the property's origin is:
/// beta~ = beta + beta_step, gamma~ = gamma (1 + excess), 1/kappa~ = inv_kappa, tau~ = tau + shift.
struct NigUpdate {
  V beta_step;
  V gain;  ///< beta_step/beta
  V excess;
  V curve;  ///< log_curve(excess)
  V inv_kappa, shift;
  V pull;  ///< kappa (beta/gamma) shift^2
};

HWY_INLINE V clamp_count(V x) { return clamp_to(x, kLeastCount, kMostCount); }

HWY_INLINE M in_range(V x, float least, float most) {
  return pair::And(pair::Ge(x, constant(least)), pair::Le(x, constant(most)));  // false for NaN
}
HWY_INLINE M is_count(V x) { return in_range(x, kLeastCount, kMostCount); }

HWY_INLINE M is_usable(const NigVectors& p) {
  return pair::And(
      pair::And(is_count(p.kappa), is_count(p.beta)),
      pair::And(in_range(p.gamma, kLeastScale, kMostScale), pair::Le(pair::Abs(p.tau), constant(kMostLocation))));
}

/// Above this, ln(1 + excess) itself is kept; below, ln(1 + excess) - excess, because there the linear terms of the
/// logarithm of a mean and of the mean of the logarithms cancel and must not be formed.
constexpr float kMuchExcess = 1.0f;

HWY_INLINE V log_curve(const Log1p& of_excess, V excess) {
  return pair::IfThenElse(pair::Gt(excess, constant(kMuchExcess)), of_excess.log, of_excess.log_minus_x);
}

/// What the projection needs of a shape before and after an update.
struct ShapeTerms {
  V d, d_stepped;  ///< D(beta), D(beta~)
  V step_excess;   ///< digamma(beta~) - digamma(beta) - beta_step/beta
};

HWY_INLINE ShapeTerms shape_terms(V beta, const NigUpdate& u) {
  const Reciprocals of_beta = reciprocals(beta);
  const V d = log_minus_digamma_of(of_beta);
  const V d_stepped = log_minus_digamma_of(reciprocals(pair::Add(beta, u.beta_step)));
  return {d, d_stepped, pair::Add(log1p_of(u.gain).log_minus_x, pair::Sub(d, d_stepped))};
}

/// The same for beta >= 1 and a step of 1/2 (one exact reading), without logarithms.
HWY_INLINE ShapeTerms shape_terms_from_1(V beta, V inv_beta) {
  const V t = pair::Div(constant(1.0f), pair::Add(beta, constant(0.5f)));
  return {log_minus_digamma_from_1(inv_beta, t), shifted_log_minus_digamma(t), digamma_half_step_from_1(inv_beta, t)};
}

/// How one exact reading changes a shape, on lanes of any kind; the costly path only where a lane needs it.
HWY_INLINE ShapeTerms half_step_shape_terms(V beta, V inv_beta, const NigUpdate& u) {
  const ShapeTerms usual = shape_terms_from_1(beta, inv_beta);
  const M small = pair::Lt(beta, constant(1.0f));
  if (HWY_LIKELY(pair::AllFalse(small))) return usual;
  const ShapeTerms any = shape_terms(beta, u);
  return {pair::IfThenElse(small, any.d, usual.d), pair::IfThenElse(small, any.d_stepped, usual.d_stepped),
          pair::IfThenElse(small, any.step_excess, usual.step_excess)};
}

/// x with D(x) = s; `near` as inverse_log_minus_digamma_of has it.
HWY_INLINE V shape_of(V s, V near, V d_near) {
  const V usual = inverse_log_minus_digamma_from_1(s);
  const M small = pair::Gt(s, constant(kMostSmallD));
  if (HWY_LIKELY(pair::AllFalse(small))) return usual;
  return pair::IfThenElse(small, inverse_log_minus_digamma_of(s, near, d_near), usual);
}

constexpr float kLeastD = 0.5f / kMostCount;

/// Lanes whose result differs from the prior by more than rounding. The relative change of kappa, beta, gamma, and of
/// tau in units of the class's spread, is at most r (1 + 2 gain) (1 + 4 beta (1 + ln(1 + excess)) + 4 beta_step) where
/// kappa is not below 0.01.
HWY_INLINE M says_something(const NigVectors& prior, const NigUpdate& u, V r) {
  const V one = constant(1.0f), four = constant(4.0f);
  const V log_bound = pair::MulAdd(four, pair::Min(u.excess, constant(70.0f)), four);
  const V of_shape = pair::MulAdd(prior.beta, log_bound, pair::MulAdd(four, u.beta_step, one));
  const V change = pair::Mul(pair::Mul(r, pair::MulAdd(constant(2.0f), u.gain, one)), of_shape);
  const M loud = pair::Or(pair::Gt(change, constant(1e-8f)), pair::Lt(prior.kappa, constant(0.01f)));
  return pair::And(loud, pair::Gt(r, pair::Zero()));
}

/// `kl`: INFERENCE of E[lambda], E[mu lambda], E[mu^2 lambda], E[log lambda]. Written about the side of greater weight
/// (prior or update), m = min(r, not_r): everything else is a correction that vanishes with m.
HWY_INLINE NigVectors project_kl(const NigVectors& prior, V inv_beta, const ShapeTerms& shape, const NigUpdate& u, V r,
                                 V not_r) {
  const V one = constant(1.0f), zero = pair::Zero();
  const M minor = pair::Le(r, constant(0.5f));
  const V m = pair::Min(r, not_r);
  const V gain1 = pair::Add(one, u.gain), excess1 = pair::Add(one, u.excess);
  const V inv_own = pair::Div(one, pair::IfThenElse(minor, excess1, gain1));
  // E[lambda] of the lighter side over that of the heavier: `ratio`, and less 1.
  const V ratio = pair::Mul(pair::IfThenElse(minor, gain1, excess1), inv_own);
  const V gap = pair::Sub(u.gain, u.excess);
  const V less_1 = pair::Mul(pair::IfThenElse(minor, gap, pair::Neg(gap)), inv_own);
  const V x = pair::Mul(m, less_1);
  const V mean = pair::Add(one, x);  // E[lambda] over that of the heavier side, at least 1/2
  const V inv_mean = pair::Div(one, mean);
  const V w = pair::Mul(pair::Mul(r, inv_mean), pair::IfThenElse(minor, ratio, one));
  const V inv_mean_to_prior = pair::Mul(inv_mean, pair::IfThenElse(minor, one, ratio));

  // D(beta^) = D(heavier beta) + ln(mean) +- m (ln(1 + excess) - [digamma(beta~) - digamma(beta)]), + for `minor`.
  const M much = pair::Gt(u.excess, constant(kMuchExcess));
  const Log1p of_mean = log1p_of(x, mean);
  const V digammas = pair::Add(shape.step_excess, pair::IfThenElseZero(much, u.gain));
  const V logs = pair::Sub(u.curve, digammas);
  const V cross = pair::IfThenElse(much, zero, pair::Mul(pair::IfThenElse(minor, u.excess, u.gain), less_1));
  const V per_m = pair::Sub(pair::IfThenElse(minor, logs, pair::Neg(logs)), cross);
  const V d = pair::Add(pair::IfThenElse(minor, shape.d, shape.d_stepped),
                        pair::MulAdd(m, per_m, pair::IfThenElse(much, of_mean.log, of_mean.log_minus_x)));
  const V beta = clamp_count(shape_of(pair::Max(d, constant(kLeastD)), prior.beta, shape.d));

  const V spread = pair::Mul(pair::Min(u.pull, constant(kMostScale)), pair::Mul(w, not_r));
  const V kappa =
      pair::Div(prior.kappa, pair::Add(pair::MulAdd(r, pair::Mul(prior.kappa, u.inv_kappa), not_r), spread));
  const V gamma = pair::Mul(pair::Mul(prior.gamma, pair::Mul(beta, inv_beta)), inv_mean_to_prior);
  return {clamp_to(pair::MulAdd(w, u.shift, prior.tau), -kMostLocation, kMostLocation), clamp_count(kappa), beta,
          clamp_to(gamma, kLeastScale, kMostScale)};
}

/// `published`: E[mu], E[lambda], E[lambda^2], E[mu^2 lambda] with the location at tau + tau_origin. Not clamped: out
/// of range means refused.
HWY_INLINE NigVectors project_published(const NigVectors& prior, V tau_origin, V inv_beta, const NigUpdate& u, V r,
                                        V not_r) {
  const V one = constant(1.0f);
  const V inverse = pair::Div(one, pair::Add(one, u.excess));
  const V q = pair::Mul(pair::Add(one, u.gain), inverse);  // E[lambda] updated : prior
  const V q_less_1 = pair::Mul(pair::Sub(u.gain, u.excess), inverse);
  const V mean = pair::MulAdd(r, q, not_r);
  const V e0 = pair::Div(prior.beta, prior.gamma);
  const V tau = pair::MulAdd(r, u.shift, prior.tau);
  const V both = pair::Mul(r, not_r);
  const V origin_term = pair::Mul(pair::Mul(constant(2.0f), pair::Add(tau, tau_origin)), q_less_1);
  const V own_term = pair::Mul(u.shift, pair::MulAdd(not_r, q, r));
  const V inv_kappa = pair::MulAdd(pair::Mul(pair::Mul(both, u.shift), e0), pair::Add(origin_term, own_term),
                                   pair::MulAdd(r, u.inv_kappa, pair::Div(not_r, prior.kappa)));
  const V inv_beta1 = pair::Div(one, pair::Add(prior.beta, u.beta_step));
  const V rq = pair::Mul(r, q);
  const V variance = pair::MulAdd(pair::Mul(rq, q), inv_beta1,
                                  pair::MulAdd(not_r, inv_beta, pair::Mul(both, pair::Mul(q_less_1, q_less_1))));
  const V inv_rate = pair::Div(mean, variance);
  const M says = pair::Gt(r, pair::Zero());
  return {pair::IfThenElse(says, tau, prior.tau), pair::IfThenElse(says, pair::Div(one, inv_kappa), prior.kappa),
          pair::IfThenElse(says, pair::Mul(mean, inv_rate), prior.beta),
          pair::IfThenElse(says, pair::Div(inv_rate, e0), prior.gamma)};
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
