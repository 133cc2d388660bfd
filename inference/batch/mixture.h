#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "inference/batch/counts.h"
#include "inference/projection.h"

namespace felt {

/// Planes of one class, `n` floats each, class-major (structure of arrays); a block of the map has one such set a
/// class. tau is stored less `tau_origin` (the class's prior location, say), so that f32 keeps its digits wherever the
/// property's origin is. A class without a prior for the property has null tau, kappa, beta and gamma: its
/// responsibility is 0, the others share the mass, and its concentration still takes part in the Dirichlet projection.
struct MixturePlanes {
  float* a = nullptr;      ///< Dirichlet concentration
  float* tau = nullptr;    ///< NIG location less tau_origin, units of the property
  float* kappa = nullptr;  ///< NIG pseudo-count
  float* beta = nullptr;   ///< NIG shape
  float* gamma = nullptr;  ///< NIG scale, units squared
  double tau_origin = 0;
  float* responsibility = nullptr;  ///< written where given (updated voxels only)
};

/// `n` voxels, each with its own state over the same classes. Planes do not overlap.
struct MixtureBatch {
  size_t n = 0;
  std::span<const MixturePlanes> classes;
  const uint8_t* selected = nullptr;  ///< one byte a voxel, 0: leave it alone. Null: all
  float* log_evidence = nullptr;      ///< ln p(psi) of each updated voxel, written where given
  uint8_t* updated = nullptr;         ///< 1 where the voxel was updated, 0 where left alone or refused; where given
};

/// One reading psi (noise of sd `noise_sd` >= 0, units of the property) applied in place to every selected voxel under
/// the `mixture` model: responsibilities, NIG projection and Dirichlet projection (inference/mixture.h, mixture_update,
/// is the f64 specification). Noise takes the tempered closed form; a voxel with a class for which that errs
/// (inference/noise.h, needs_quadrature) is computed in f64, by quadrature, at a great multiple of the cost. So is,
/// with `kl`, a voxel whose concentrations sum in f32 to less than the largest of them and 1e-4.
///
/// Voxels of equal state are computed once. Results do not depend on the order of voxels, on which other voxels are in
/// the batch, or on the number of threads.
///
/// Never invalid and never NaN: a voxel is refused, and keeps its bits, where a, kappa or beta is outside
/// [1e-15, 1e15], gamma outside [1e-30, 1e30], tau not finite or beyond 1e18, psi not finite, or `published` gives no
/// valid prior. Results are clamped to those ranges.
///
/// Error of `kl` against f64 on the same f32 state, relative (tau to the larger of the class's sqrt(gamma/beta) and the
/// way tau moved), with L the largest |log evidence| among the classes that matter: 1e-5 + 1e-6 L for tau, kappa, beta,
/// gamma and r (f32 keeps a log evidence to 2e-7 of itself, so a reading that every class finds thousands of nats
/// surprising moves r by more). For a: 2e-5 with concentrations of 1 and above in the prior; otherwise 2e-5 and what
/// that error of r, and two roundings of r/a, do to the exact solution, up to 1e-3 where all classes
/// but one are rare (1e-4 beside 10) and little determines the sum: docs/batch_kernels.md has the formula. `published`:
/// as `kl` where 1/kappa^ is no near-cancelling sum. The targets with fused multiply-add (avx2, avx3) give the same
/// bits; sse4 differs within the bound; "scalar" is f64 rounded once.
BatchCounts update_mixture(const MixtureBatch& batch, double psi, double noise_sd = 0,
                           Projection projection = Projection::kl) noexcept;

/// The same for many batches (the blocks of a region), one task each.
BatchCounts update_mixture(std::span<const MixtureBatch> batches, double psi, double noise_sd = 0,
                           Projection projection = Projection::kl) noexcept;

}  // namespace felt
