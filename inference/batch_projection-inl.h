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

HWY_INLINE V clamp_to(V x, float least, float most) { return hn::Min(hn::Max(x, constant(least)), constant(most)); }
HWY_INLINE V clamp_count(V x) { return clamp_to(x, kLeastCount, kMostCount); }

HWY_INLINE M in_range(V x, float least, float most) {
  return hn::And(hn::Ge(x, constant(least)), hn::Le(x, constant(most)));  // false for NaN
}
HWY_INLINE M is_count(V x) { return in_range(x, kLeastCount, kMostCount); }

HWY_INLINE M is_usable(const NigVectors& p) {
  return hn::And(hn::And(is_count(p.kappa), is_count(p.beta)),
                 hn::And(in_range(p.gamma, kLeastScale, kMostScale), hn::Le(hn::Abs(p.tau), constant(kMostLocation))));
}

/// ln(1 + r d) - r ln(1 + d) >= 0 with q = 1 + d, r <= 1/2: how far the logarithm of a mean lies above the mean of the
/// logarithms. The linear terms cancel before they are formed, except where d is large and nothing cancels.
HWY_INLINE V jensen_gap(V r, V d, V q) {
  const Log1p mean = log1p_of(hn::Mul(r, d)), each = log1p_of(d, q);
  const M large = hn::Gt(d, constant(1.0f));
  return hn::NegMulAdd(r, hn::IfThenElse(large, each.log, each.log_minus_x),
                       hn::IfThenElse(large, mean.log, mean.log_minus_x));
}

/// Means of the mixture of precisions, relative to the prior's E[lambda] = beta/gamma.
struct PrecisionRatio {
  V q;  ///< E[lambda] updated : prior
  V q_less_1;
  V mean;  ///< r q + not_r
};

HWY_INLINE PrecisionRatio precision_ratio(const NigUpdate& u, V inv_beta, V r, V not_r) {
  const V one = constant(1.0f);
  const V gain = hn::Mul(u.beta_step, inv_beta);
  const V inverse = hn::Div(one, hn::Add(one, u.excess));
  const V q = hn::Mul(hn::Add(one, gain), inverse);
  return {q, hn::Mul(hn::Sub(gain, u.excess), inverse), hn::MulAdd(r, q, not_r)};
}

/// `kl`: INFERENCE of E[lambda], E[mu lambda], E[mu^2 lambda], E[log lambda]. `of_beta`: reciprocals of prior.beta.
HWY_INLINE NigVectors project_kl(const NigVectors& prior, Reciprocals of_beta, const NigUpdate& u, V r, V not_r) {
  const V one = constant(1.0f);
  const PrecisionRatio ratio = precision_ratio(u, of_beta.of_x, r, not_r);
  const V inv_mean = hn::Div(one, ratio.mean);
  const V w = hn::Mul(hn::Mul(r, ratio.q), inv_mean);
  const V beta1 = hn::Add(prior.beta, u.beta_step);

  const M minor = hn::Le(r, constant(0.5f));
  const V inv_q = hn::Div(one, ratio.q);
  const V gap =
      jensen_gap(hn::Min(r, not_r), hn::IfThenElse(minor, ratio.q_less_1, hn::Neg(hn::Mul(ratio.q_less_1, inv_q))),
                 hn::IfThenElse(minor, ratio.q, inv_q));
  const V d0 = log_minus_digamma_of(of_beta), d1 = log_minus_digamma_of(reciprocals(beta1));
  const V beta =
      clamp_count(inverse_log_minus_digamma_of(hn::Add(gap, hn::MulAdd(r, d1, hn::Mul(not_r, d0))), prior.beta, d0));

  // kappa E0 shift^2 = 2 beta excess / kappa~ for one reading; in general it is formed from the shift itself.
  const V pull = hn::Mul(hn::Mul(prior.beta, hn::Mul(u.shift, u.shift)), hn::Div(prior.kappa, prior.gamma));
  const V spread = hn::Mul(hn::Min(pull, constant(kMostScale)), hn::Mul(w, not_r));
  const V kappa = hn::Div(prior.kappa, hn::Add(hn::MulAdd(r, hn::Mul(prior.kappa, u.inv_kappa), not_r), spread));
  const V gamma = hn::Mul(hn::Mul(prior.gamma, hn::Mul(beta, of_beta.of_x)), inv_mean);

  const M says_something = hn::Gt(r, hn::Zero(F()));
  return {hn::IfThenElse(says_something, clamp_to(hn::MulAdd(w, u.shift, prior.tau), -kMostLocation, kMostLocation),
                         prior.tau),
          hn::IfThenElse(says_something, clamp_count(kappa), prior.kappa),
          hn::IfThenElse(says_something, beta, prior.beta),
          hn::IfThenElse(says_something, clamp_to(gamma, kLeastScale, kMostScale), prior.gamma)};
}

/// `published`: E[mu], E[lambda], E[lambda^2], E[mu^2 lambda] with the location at tau + tau_origin. Not clamped: out
/// of range means refused.
HWY_INLINE NigVectors project_published(const NigVectors& prior, V tau_origin, Reciprocals of_beta, const NigUpdate& u,
                                        V r, V not_r) {
  const V one = constant(1.0f);
  const PrecisionRatio ratio = precision_ratio(u, of_beta.of_x, r, not_r);
  const V e0 = hn::Div(prior.beta, prior.gamma);
  const V tau = hn::MulAdd(r, u.shift, prior.tau);
  const V both = hn::Mul(r, not_r);
  const V origin_term = hn::Mul(hn::Mul(constant(2.0f), hn::Add(tau, tau_origin)), ratio.q_less_1);
  const V own_term = hn::Mul(u.shift, hn::MulAdd(not_r, ratio.q, r));
  const V inv_kappa = hn::MulAdd(hn::Mul(hn::Mul(both, u.shift), e0), hn::Add(origin_term, own_term),
                                 hn::MulAdd(r, u.inv_kappa, hn::Div(not_r, prior.kappa)));
  const V inv_beta1 = hn::Div(one, hn::Add(prior.beta, u.beta_step));
  const V rq = hn::Mul(r, ratio.q);
  const V variance =
      hn::MulAdd(hn::Mul(rq, ratio.q), inv_beta1,
                 hn::MulAdd(not_r, of_beta.of_x, hn::Mul(both, hn::Mul(ratio.q_less_1, ratio.q_less_1))));
  const V inv_rate = hn::Div(ratio.mean, variance);
  const M says_something = hn::Gt(r, hn::Zero(F()));
  return {hn::IfThenElse(says_something, tau, prior.tau),
          hn::IfThenElse(says_something, hn::Div(one, inv_kappa), prior.kappa),
          hn::IfThenElse(says_something, hn::Mul(ratio.mean, inv_rate), prior.beta),
          hn::IfThenElse(says_something, hn::Div(inv_rate, e0), prior.gamma)};
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
