#pragma once

#include <vector>

#include "inference/batch/limits.h"
#include "inference/batch/material.h"

namespace felt {

/// Class posterior and view of every state of `states`, whose n is a multiple of kBatchLanes and whose planes are all
/// given. Writes p(class) to `a` (not times A + n; `concentration` is not read). For states that `fits_kernel`.
/// `scratch` is reused between calls.
void material_kernel_simd(const MaterialBatch& states, double rho, std::vector<float>& scratch) noexcept;

/// The same by f64 `material_posterior` and `moment_matched_view` for one state, whatever its size.
void material_kernel_scalar(const MaterialBatch& states, size_t state, double rho) noexcept;

/// Whether the numbers of a prior are within what the f32 kernel can hold.
inline bool fits_kernel(const Nig& p) {
  const auto within = [](double x, float least, float most) { return x >= double(least) && x <= double(most); };
  return within(p.kappa, kLeastCount, kMostCount) && within(p.beta, kLeastCount, kMostCount) &&
         within(p.gamma, kLeastScale, kMostScale);
}

}  // namespace felt
