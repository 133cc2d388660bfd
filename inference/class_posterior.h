#pragma once

#include <span>
#include <vector>

namespace felt {

/// Posterior over classes: p(c) proportional to weight_c exp(log_likelihood_c).
struct ClassPosterior {
  std::vector<double> p;      ///< sums to 1
  std::vector<double> not_p;  ///< 1 - p, exact also where p is within rounding of 1
  double log_evidence = 0;    ///< ln sum_c (weight_c / sum weight) exp(log_likelihood_c): the surprise
};

/// Evaluated in logs. `weight` need not sum to 1 (concentrations or beliefs); a log-likelihood of minus infinity means
/// that the class takes no part: its p is 0, its weight is left out, and the others share the mass. Throws Error where
/// no class takes part.
ClassPosterior class_posterior(std::span<const double> weight, std::span<const double> log_likelihood);

}  // namespace felt
