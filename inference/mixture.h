#pragma once

#include <span>
#include <vector>

#include "inference/class_posterior.h"
#include "inference/nig.h"
#include "inference/projection.h"

namespace felt {

/// State after one reading under the `mixture` model (Ewen et al., Algorithm 1, with the corrections of
/// docs/inference.md).
struct MixtureUpdate {
  ClassPosterior responsibility;  ///< which class produced the reading; log_evidence = ln p(psi)
  std::vector<double> a;          ///< projected Dirichlet concentrations
  std::vector<Nig> nig;           ///< projected blocks; a class without a prior stays without
  bool valid = true;              ///< all of a, kappa, beta, gamma positive and finite. `kl`: always
};

/// Which class produced reading psi: r_j proportional to a_j times the Student-t of class j. `a`: concentrations;
/// `prior`: one block a class, `has_prior` false for classes that take no part. `noise_sd` >= 0 in units of the
/// property (inference/noise.h).
ClassPosterior responsibilities(std::span<const double> a, std::span<const Nig> prior, double psi, double noise_sd = 0);

/// One touch: the exact posterior sum_j r_j Dir(a + e_j) NIG~_j prod_{i != j} NIG_i, projected back to one product.
/// With `published` the result may be invalid: it is returned as computed, and the caller keeps its state and counts
/// the case.
MixtureUpdate mixture_update(std::span<const double> a, std::span<const Nig> prior, double psi, double noise_sd = 0,
                             Projection projection = Projection::kl);

}  // namespace felt
