// Projection of r NIG~ + (1 - r) NIG to one NIG on Highway vectors, shared by the batch kernels. Included once per SIMD
// target. inference/projection.h is the specification.
#if defined(FELT_INFERENCE_BATCH_PROJECTION_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_PROJECTION_INL_H_
#undef FELT_INFERENCE_BATCH_PROJECTION_INL_H_
#else
#define FELT_INFERENCE_BATCH_PROJECTION_INL_H_
#endif

#include <hwy/highway.h>

#include "inference/batch_math-inl.h"
#include "inference/batch_mixture_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

struct NigVectors {
  V tau, kappa, beta, gamma;
};

/// The update of one class in relative terms, so that nothing depends on where the property's origin is:
/// beta~ = beta + beta_step, gamma~ = gamma (1 + excess), 1/kappa~ = inv_kappa, tau~ = tau + shift.
struct NigUpdate {
  V beta_step, excess, inv_kappa, shift;
};

HWY_INLINE V clamp_to(V x, float least, float most) { return pair::Min(pair::Max(x, constant(least)), constant(most)); }
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

/// ln(1 + r d) - r ln(1 + d) >= 0 with q = 1 + d, r <= 1/2: how far the logarithm of a mean lies above the mean of the
/// logarithms. The linear terms cancel before they are formed, except where d is large and nothing cancels.
HWY_INLINE V jensen_gap(V r, V d, V q) {
  const Log1p mean = log1p_of(pair::Mul(r, d)), each = log1p_of(d, q);
  const M large = pair::Gt(d, constant(1.0f));
  return pair::NegMulAdd(r, pair::IfThenElse(large, each.log, each.log_minus_x),
                         pair::IfThenElse(large, mean.log, mean.log_minus_x));
}

/// Means of the mixture of precisions, relative to the prior's E[lambda] = beta/gamma.
struct PrecisionRatio {
  V q;  ///< E[lambda] updated : prior
  V q_less_1;
  V mean;  ///< r q + not_r
};

HWY_INLINE PrecisionRatio precision_ratio(const NigUpdate& u, V inv_beta, V r, V not_r) {
  const V one = constant(1.0f);
  const V gain = pair::Mul(u.beta_step, inv_beta);
  const V inverse = pair::Div(one, pair::Add(one, u.excess));
  const V q = pair::Mul(pair::Add(one, gain), inverse);
  return {q, pair::Mul(pair::Sub(gain, u.excess), inverse), pair::MulAdd(r, q, not_r)};
}

/// `kl`: INFERENCE of E[lambda], E[mu lambda], E[mu^2 lambda], E[log lambda]. `of_beta`: reciprocals of prior.beta.
HWY_INLINE NigVectors project_kl(const NigVectors& prior, Reciprocals of_beta, const NigUpdate& u, V r, V not_r) {
  const V one = constant(1.0f);
  const PrecisionRatio ratio = precision_ratio(u, of_beta.of_x, r, not_r);
  const V inv_mean = pair::Div(one, ratio.mean);
  const V w = pair::Mul(pair::Mul(r, ratio.q), inv_mean);
  const V beta1 = pair::Add(prior.beta, u.beta_step);

  const M minor = pair::Le(r, constant(0.5f));
  const V inv_q = pair::Div(one, ratio.q);
  const V gap = jensen_gap(pair::Min(r, not_r),
                           pair::IfThenElse(minor, ratio.q_less_1, pair::Neg(pair::Mul(ratio.q_less_1, inv_q))),
                           pair::IfThenElse(minor, ratio.q, inv_q));
  const V d0 = log_minus_digamma_of(of_beta), d1 = log_minus_digamma_of(reciprocals(beta1));
  const V beta = clamp_count(
      inverse_log_minus_digamma_of(pair::Add(gap, pair::MulAdd(r, d1, pair::Mul(not_r, d0))), prior.beta, d0));

  // kappa E0 shift^2 = 2 beta excess / kappa~ for one reading; in general it is formed from the shift itself.
  const V pull = pair::Mul(pair::Mul(prior.beta, pair::Mul(u.shift, u.shift)), pair::Div(prior.kappa, prior.gamma));
  const V spread = pair::Mul(pair::Min(pull, constant(kMostScale)), pair::Mul(w, not_r));
  const V kappa =
      pair::Div(prior.kappa, pair::Add(pair::MulAdd(r, pair::Mul(prior.kappa, u.inv_kappa), not_r), spread));
  const V gamma = pair::Mul(pair::Mul(prior.gamma, pair::Mul(beta, of_beta.of_x)), inv_mean);

  const M says_something = pair::Gt(r, pair::Zero());
  return {pair::IfThenElse(says_something, clamp_to(pair::MulAdd(w, u.shift, prior.tau), -kMostLocation, kMostLocation),
                           prior.tau),
          pair::IfThenElse(says_something, clamp_count(kappa), prior.kappa),
          pair::IfThenElse(says_something, beta, prior.beta),
          pair::IfThenElse(says_something, clamp_to(gamma, kLeastScale, kMostScale), prior.gamma)};
}

/// `published`: E[mu], E[lambda], E[lambda^2], E[mu^2 lambda] with the location at tau + tau_origin. Not clamped: out
/// of range means refused.
HWY_INLINE NigVectors project_published(const NigVectors& prior, V tau_origin, Reciprocals of_beta, const NigUpdate& u,
                                        V r, V not_r) {
  const V one = constant(1.0f);
  const PrecisionRatio ratio = precision_ratio(u, of_beta.of_x, r, not_r);
  const V e0 = pair::Div(prior.beta, prior.gamma);
  const V tau = pair::MulAdd(r, u.shift, prior.tau);
  const V both = pair::Mul(r, not_r);
  const V origin_term = pair::Mul(pair::Mul(constant(2.0f), pair::Add(tau, tau_origin)), ratio.q_less_1);
  const V own_term = pair::Mul(u.shift, pair::MulAdd(not_r, ratio.q, r));
  const V inv_kappa = pair::MulAdd(pair::Mul(pair::Mul(both, u.shift), e0), pair::Add(origin_term, own_term),
                                   pair::MulAdd(r, u.inv_kappa, pair::Div(not_r, prior.kappa)));
  const V inv_beta1 = pair::Div(one, pair::Add(prior.beta, u.beta_step));
  const V rq = pair::Mul(r, ratio.q);
  const V variance =
      pair::MulAdd(pair::Mul(rq, ratio.q), inv_beta1,
                   pair::MulAdd(not_r, of_beta.of_x, pair::Mul(both, pair::Mul(ratio.q_less_1, ratio.q_less_1))));
  const V inv_rate = pair::Div(ratio.mean, variance);
  const M says_something = pair::Gt(r, pair::Zero());
  return {pair::IfThenElse(says_something, tau, prior.tau),
          pair::IfThenElse(says_something, pair::Div(one, inv_kappa), prior.kappa),
          pair::IfThenElse(says_something, pair::Mul(ratio.mean, inv_rate), prior.beta),
          pair::IfThenElse(says_something, pair::Div(inv_rate, e0), prior.gamma)};
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
