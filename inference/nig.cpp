#include "inference/nig.h"

#include <cmath>

namespace felt {

bool is_valid(const Nig& p) {
  const auto positive = [](double x) { return x > 0 && std::isfinite(x); };
  return std::isfinite(p.tau) && positive(p.kappa) && positive(p.beta) && positive(p.gamma);
}

Nig conjugate_update(const Nig& prior, double psi) {
  const double d = psi - prior.tau;
  const double kappa = prior.kappa + 1;
  return {prior.tau + d / kappa, kappa, prior.beta + 0.5, prior.gamma + prior.kappa * d * d / (2 * kappa)};
}

StudentT predictive(const Nig& p) { return {p.tau, plug_in_variance(p) * (1 + 1 / p.kappa), 2 * p.beta}; }

double log_evidence(const Nig& prior, double psi) { return log_pdf(predictive(prior), psi); }

}  // namespace felt
