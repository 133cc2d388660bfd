#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "inference/batch/limits.h"
#include "inference/batch/mixture.h"

namespace felt {

/// What the kernels need of one reading.
struct MixtureReading {
  double psi = 0;
  double noise_sd = 0;
  Projection projection = Projection::kl;
};

/// What a kernel says of a voxel in `MixtureBatch::updated`.
enum : uint8_t {
  kRefused = 0,
  kUpdated = 1,
  kNeedsF64 = 2,  ///< some class may need quadrature (inference/noise.h, needs_quadrature), or one holds nearly all
};

/// Voxels [begin, end) of `batch`, both multiples of kBatchLanes. Does not look at `selected`; `updated` must be given.
/// `scratch` is reused between calls.
void mixture_kernel_simd(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading,
                         std::vector<float>& scratch) noexcept;

/// The same by f64 `mixture_update`, any begin and end, any noise.
void mixture_kernel_scalar(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading) noexcept;

}  // namespace felt
