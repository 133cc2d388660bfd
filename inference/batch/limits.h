#pragma once

#include <cstddef>

namespace felt {

/// Kernels work on whole vectors: voxel counts are multiples of this (two of the widest vectors).
inline constexpr size_t kBatchLanes = 32;

/// Where the sum of all concentrations exceeds the largest by less, `kl` computes a voxel in f64: little determines the
/// sum of the result then, and f32 loses it altogether from 1e-7 on (docs/batch_kernels.md).
inline constexpr float kLeastOthers = 1e-4f;

/// Ranges of f32 states outside of which a voxel is refused and to which results are clamped.
inline constexpr float kLeastCount = 1e-15f, kMostCount = 1e15f;  // a, kappa, beta
inline constexpr float kLeastScale = 1e-30f, kMostScale = 1e30f;  // gamma
inline constexpr float kMostLocation = 1e18f;                     // |tau - tau_origin|

}  // namespace felt
