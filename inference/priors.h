#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "inference/nig.h"
#include "inference/student_t.h"

namespace felt {

/// Pseudo-observations that a prior stands for where nothing else is said: a map must still learn from its touches.
constexpr double kDefaultPriorReadings = 50;
/// Intra-class correlation where nothing is known.
constexpr double kDefaultRho = 0.5;

/// Prior worth nu_0 readings of mean `mean` and standard deviation `sd` > 0: kappa = nu_0, beta = nu_0/2,
/// gamma = beta sd^2, so that E of the precision is 1/sd^2.
Nig calibrated_prior(double mean, double sd, double nu_0 = kDefaultPriorReadings);

/// Initialisation as printed in Ewen et al., for comparison only: beta = sd^2/mean, gamma = sqrt(beta)/divisor, kappa
/// = 1. It has units, and does not exist for mean <= 0: empty then. The printed friction table and its text agree with
/// a divisor of 40.
std::optional<Nig> published_prior(double mean, double sd, double divisor = 40);

/// The classes' predictives weighted by a belief: distribution of the next reading. Classes without a prior drop out
/// and the others share their mass.
StudentTMixture predictive_mixture(std::span<const double> belief, std::span<const Nig> nig);

/// Normal density of the plug-in at E of the parameters (for plots and for comparison with the paper's figures).
struct PlugInNormal {
  double weight = 0;
  double mean = 0;
  double sd = 0;
};
std::vector<PlugInNormal> plug_in_mixture(std::span<const double> belief, std::span<const Nig> nig);

}  // namespace felt
