#include "inference/projection.h"

#include <cmath>

#include "inference/special_functions.h"

namespace felt {
namespace {

// ln(not_r + r e^x) - r x >= 0: how far the logarithm of the mean precision lies above the mean of the logarithms.
double jensen_gap(double r, double not_r, double x) {
  if (x > 0) return jensen_gap(not_r, r, -x);
  if (x > -0.5) return std::log1p(r * std::expm1(x)) - r * x;
  return std::log(not_r + r * std::exp(x)) - r * x;
}

}  // namespace

Nig project_nig_kl(const Nig& prior, const Nig& updated, double r, double not_r) {
  if (!(r > 0)) return prior;
  if (!(not_r > 0)) return updated;
  const double e0 = prior.beta / prior.gamma, e1 = updated.beta / updated.gamma;
  const double mean_precision = r * e1 + not_r * e0;
  const double w = r * e1 / mean_precision, not_w = not_r * e0 / mean_precision;
  const double shift = updated.tau - prior.tau;
  const double log_ratio = e1 > 0.5 * e0 ? std::log1p((e1 - e0) / e0) : std::log(e1 / e0);
  const double inverse_kappa = r / updated.kappa + not_r / prior.kappa + mean_precision * w * not_w * shift * shift;
  const double beta = inverse_log_minus_digamma(jensen_gap(r, not_r, log_ratio) + r * log_minus_digamma(updated.beta) +
                                                not_r * log_minus_digamma(prior.beta));
  return {prior.tau + w * shift, 1 / inverse_kappa, beta, beta / mean_precision};
}

Nig project_nig_published(const Nig& prior, const Nig& updated, double r, double not_r) {
  const double e0 = prior.beta / prior.gamma, e1 = updated.beta / updated.gamma;
  const double shift = updated.tau - prior.tau;
  const double mean = prior.tau + r * shift;
  const double mean_precision = r * e1 + not_r * e0;
  // E[mu^2 lambda] - E[mu]^2 E[lambda], expanded about E[mu]: only the term in 2 E[mu] knows the origin.
  const double inverse_kappa = r / updated.kappa + not_r / prior.kappa +
                               r * not_r * shift * (2 * mean * (e1 - e0) + shift * (not_r * e1 + r * e0));
  const double variance = r * e1 / updated.gamma + not_r * e0 / prior.gamma + r * not_r * (e1 - e0) * (e1 - e0);
  return {mean, 1 / inverse_kappa, mean_precision * mean_precision / variance, mean_precision / variance};
}

}  // namespace felt
