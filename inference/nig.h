#pragma once

#include "inference/student_t.h"

namespace felt {

/// Normal-Inverse-Gamma of one property in one class: precision lambda = 1/sigma^2 ~ Gamma(shape beta, rate gamma),
/// mean mu | sigma^2 ~ N(tau, sigma^2/kappa). tau is in units of the property, gamma in units squared, kappa and beta
/// are counts. A default Nig (all zero) stands for "this class has no prior": it takes no part in touches.
struct Nig {
  double tau = 0;
  double kappa = 0;
  double beta = 0;
  double gamma = 0;
  bool operator==(const Nig&) const = default;
};

/// Whether the class has a prior, that is whether it takes part in touches.
inline bool has_prior(const Nig& p) { return p.kappa > 0; }

/// kappa, beta, gamma positive and finite, tau finite.
bool is_valid(const Nig& p);

/// gamma/beta: the class variance at the plug-in precision E[lambda] = beta/gamma.
inline double plug_in_variance(const Nig& p) { return p.gamma / p.beta; }

/// Posterior after one exact reading psi of this class.
Nig conjugate_update(const Nig& prior, double psi);

/// Distribution of the next reading of this class: 2 beta degrees of freedom, location tau, squared scale
/// (gamma/beta)(1 + 1/kappa).
StudentT predictive(const Nig& p);

/// ln p(psi | class), the log density of `predictive(prior)` at psi.
double log_evidence(const Nig& prior, double psi);

}  // namespace felt
