#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "inference/batch/counts.h"
#include "inference/nig.h"

namespace felt {

/// One class of a material batch: the property's prior, and planes of `n` floats. A class without a prior (Nig{}) has
/// probability 0 and null tau, kappa, beta and gamma.
struct MaterialPlanes {
  Nig prior;
  double tau_origin = 0;          ///< tau is written less this
  const float* belief = nullptr;  ///< vision belief pooled over the touched regions; need not sum to 1
  float* a = nullptr;             ///< written: p(class) (A + n), the Dirichlet of the moment-matched view
  float* tau = nullptr;           ///< written: NIG location less tau_origin, units of the property
  float* kappa = nullptr;         ///< written: NIG pseudo-count
  float* beta = nullptr;          ///< written: NIG shape
  float* gamma = nullptr;         ///< written: NIG scale, units squared
};

/// `n` voxels with their statistics planes (inference/material.h, ReadingStatistics) over the same classes and
/// property.
struct MaterialBatch {
  size_t n = 0;
  const float* count = nullptr;  ///< readings that cover the voxel; 0: left alone
  const float* mean = nullptr;   ///< their mean less `mean_origin`, units of the property
  const float* m2 = nullptr;     ///< sum (psi - mean)^2
  double mean_origin = 0;
  const float* concentration = nullptr;  ///< A of the voxel's vision Dirichlet
  std::span<const MaterialPlanes> classes;
  float* surprise = nullptr;  ///< ln sum_c pi(c) p(readings | c), written where given
};

/// Class posterior of the `material` model and its moment-matched view for every covered voxel, with correlation `rho`
/// in [0, 1) between readings of one region: f32 on Highway vectors, once for each distinct (statistics, belief), so
/// that a region under the same touches is one computation, whatever its size. Specified by `material_posterior` and
/// `moment_matched_view` in f64, which "scalar" runs, and which compute states whose priors or beliefs f32 vectors
/// cannot hold. Refused are covered voxels whose statistics, belief or A are not finite, negative, or without mass.
/// Outputs do not depend on the number of threads, on the order of voxels or on which other voxels are in the batch.
///
/// Error against f64, relative (p absolute; tau to the larger of the class's sqrt(gamma/beta) and the way tau moved),
/// with L the largest |log evidence| among the classes that matter: 1e-5 + 2e-6 L for p, tau, kappa, beta, gamma, and
/// that times max(1, L) for the surprise. Never NaN; kappa and beta stay in [1e-15, 1e15], gamma in [1e-30, 1e30].
BatchCounts material_view(const MaterialBatch& batch, double rho) noexcept;

/// The same for many batches (the blocks of a region), one task each.
BatchCounts material_view(std::span<const MaterialBatch> batches, double rho) noexcept;

}  // namespace felt
