#pragma once

#include <span>
#include <string>
#include <vector>

#include "inference/mixture.h"
#include "inference/student_t.h"

namespace felt::test {

/// Predictive of the next reading after `psi`, exact: summed over all k^n assignments of readings to classes.
StudentTMixture exact_predictive(std::span<const double> a, std::span<const Nig> prior, const std::vector<double>& psi);

/// A prior and how readings come about: each of class c (by weight) from a normal.
struct MixtureSetting {
  std::string name;
  std::vector<double> a;
  std::vector<Nig> prior;
  std::vector<double> weight, mean, sd;
  int readings = 6;
  unsigned seed = 0;
};

/// Two-class doors and three-class friction, with weak and strong priors, 6 to 8 readings.
std::vector<MixtureSetting> mixture_settings();

/// What sequential projection costs, over seeded sequences.
struct ProjectionError {
  int invalid_runs = 0;        ///< with at least one refused update (the state is then kept)
  double mean_divergence = 0;  ///< KL(exact predictive || predictive of the projected state) after the last reading
};
struct ProjectionErrors {
  ProjectionError kl, published;
};
ProjectionErrors projection_errors(const MixtureSetting& setting, int runs);

}  // namespace felt::test
