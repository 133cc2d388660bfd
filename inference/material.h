#pragma once

#include <span>
#include <vector>

#include "inference/class_posterior.h"
#include "inference/nig.h"
#include "inference/student_t.h"

namespace felt {

/// Sufficient statistics of the exact readings that cover a voxel (or a region).
struct ReadingStatistics {
  double n = 0;     ///< how many
  double mean = 0;  ///< units of the property
  double m2 = 0;    ///< sum (psi - mean)^2
};

ReadingStatistics statistics_of(std::span<const double> psi);

/// What the readings of one region say under one class.
struct MaterialClass {
  double log_evidence = 0;  ///< ln p(readings | class); minus infinity for a class without a prior
  Nig posterior;       ///< of the class's mean and precision: the next reading elsewhere is `predictive(posterior)`
  StudentT next_here;  ///< the next exact reading in this region
};

/// Readings psi_1..n of one class, exchangeable with correlation rho in [0, 1) within their region (covariance
/// sigma^2 [(1-rho) I + rho 1 1^T] about mu). n = 0 returns the prior.
MaterialClass material_class(const Nig& prior, const ReadingStatistics& readings, double rho);

/// The `material` model: all readings of a region share one class.
struct MaterialPosterior {
  ClassPosterior belief;               ///< p(class | readings, vision); log_evidence is the surprise
  std::vector<MaterialClass> classes;  ///< one a class; `posterior` is Nig{} for classes without a prior
};

/// `vision_belief`: pooled over the union of the touched regions (need not sum to 1); `prior`: one block a class.
MaterialPosterior material_posterior(std::span<const double> vision_belief, std::span<const Nig> prior,
                                     const ReadingStatistics& readings, double rho);

/// The same with noise of known sd on each reading (`noise_sd` empty: exact). See inference/noise.h.
MaterialPosterior material_posterior(std::span<const double> vision_belief, std::span<const Nig> prior,
                                     std::span<const double> psi, std::span<const double> noise_sd, double rho);

/// A state of `mixture` form (Dirichlet times NIG blocks) that shows a `material` posterior to viewers and planners.
struct MomentMatchedView {
  /// Mean p(class), total `total_concentration`; a class of probability 0 gets the least float.
  std::vector<double> a;
  std::vector<Nig> nig;  ///< `kl` projection of p(c) NIG_n + (1 - p(c)) NIG
};

/// `total_concentration`: A + n of the voxel.
MomentMatchedView moment_matched_view(const MaterialPosterior& posterior, std::span<const Nig> prior,
                                      double total_concentration);

}  // namespace felt
