#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "inference/batch_mixture.h"

namespace felt {

/// Kernels work on whole vectors: voxel counts are multiples of this (two of the widest vectors).
inline constexpr size_t kBatchLanes = 32;

/// What the kernels need of one reading.
struct MixtureReading {
  double psi = 0;
  double noise_sd = 0;
  Projection projection = Projection::kl;
};

/// Ranges outside of which a state is refused and to which results are clamped.
inline constexpr float kLeastCount = 1e-15f, kMostCount = 1e15f;  // a, kappa, beta
inline constexpr float kLeastScale = 1e-30f, kMostScale = 1e30f;  // gamma
inline constexpr float kMostLocation = 1e18f;                     // |tau - tau_origin|

/// What a kernel says of a voxel in `MixtureBatch::updated`.
enum : uint8_t {
  kRefused = 0,
  kUpdated = 1,
  kTooNoisy = 2,  ///< some class may need quadrature (inference/noise.h, needs_quadrature)
};

/// Voxels [begin, end) of `batch`, both multiples of kBatchLanes. Does not look at `selected`; `updated` must be given.
/// `scratch` is reused between calls.
void mixture_kernel_simd(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading,
                         std::vector<float>& scratch) noexcept;

/// The same by f64 `mixture_update`, any begin and end, any noise.
void mixture_kernel_scalar(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading) noexcept;

}  // namespace felt
