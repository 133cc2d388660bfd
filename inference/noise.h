#pragma once

#include <span>

#include "inference/material.h"

namespace felt {

// A reading psi = (draw from the class) + N(0, noise_sd^2). The exact posterior of a class is no NIG any more. Two
// paths: a closed form that tempers the reading by s = v/(v + noise_sd^2), v = gamma/beta the class variance, and a
// quadrature over the precision that is exact up to its last step (the `kl` projection to a NIG). docs/inference.md
// tabulates the difference over noise_sd^2/v.

/// What one reading says under one class.
struct NoisyReading {
  double log_evidence = 0;
  Nig posterior;
};

/// Whether the closed form may err by more than 0.03 nat in the log evidence. Of one reading: where
/// noise_sd^2 (1 + z^2)^2 > v/3, z its distance from tau in predictive standard deviations; always so above
/// noise_sd^2 = v/3, in the tails earlier, and where the prior stands for less than three readings (beta < 1.5). Always
/// of several readings, whose errors add up.
bool needs_quadrature(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd);

/// The update to use: exact without noise, else quadrature where it is needed and the closed form elsewhere.
NoisyReading noisy_update(const Nig& prior, double psi, double noise_sd);

/// Several readings of one region with correlation rho in [0, 1) between them and noise of its own on each (`noise_sd`:
/// one a reading), by the same choice.
MaterialClass noisy_material_class(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd,
                                   double rho);

/// Closed form. With one reading: kappa + s, tau by weights, beta + s/2, gamma + s^2 kappa d^2 / (2 (kappa + s)).
MaterialClass tempered_material_class(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd,
                                      double rho);

/// Evidence, posterior and next reading from one-dimensional quadrature over the precision (relative error below
/// 1e-10).
MaterialClass quadrature_material_class(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd,
                                        double rho);

}  // namespace felt
