#pragma once

#include <array>
#include <cstdint>

#include "mapping/region.h"

namespace felt {

// Which voxels of a block's surface a region may grow through. Every target gives the scalar version's bits.

/// Signed distance of a block and of two voxels around it, metres; NaN where nothing was observed.
struct SurfaceTile {
  static constexpr int kHalo = 2, kSide = 8 + 2 * kHalo, kRow = 16, kFirstZ = 4;
  static constexpr int kStepX = kSide * kRow, kStepY = kRow;
  /// Place of voxel (x, y, z) of the block, each in -2 .. 9. Rows along z are padded.
  static constexpr int index(int x, int y, int z) { return (x + kHalo) * kStepX + (y + kHalo) * kStepY + z + kFirstZ; }

  alignas(64) float tsdf[kSide * kSide * kRow];
};

/// By x + 2: bit y + 2 of the rows (x, y), x and y in -2 .. 9, that lie within `reach` (0 .. 2) rows of one with a bit
/// of a block's mask in it. `words`: of the mask.
std::array<uint16_t, SurfaceTile::kSide> rows_near(const std::array<uint64_t, 8>& words, int reach);

/// A unit vector, or zero.
struct SurfaceNormal {
  float x = 0, y = 0, z = 0;
};

/// Direction in which the signed distance grows fastest around an observed voxel of the tile (-1 .. 8): the plane that
/// fits the 27 voxels around it best, which halves to thirds the noise of central differences. Where some of them were
/// never observed, the mean of what slopes there are along each axis. Zero where there is none.
SurfaceNormal smoothed_normal(const SurfaceTile& tile, int at) noexcept;

/// The voxels of `candidate` (voxels of the band, |tsdf| <= band_m) whose neighbours in the band, of 26, all have
/// smoothed normals n with n . n' >= cos_limit. Rows farther than two from a candidate's are not read.
BlockMask interior_voxels(const SurfaceTile& tile, const BlockMask& candidate, float band_m, float cos_limit) noexcept;
BlockMask interior_voxels_scalar(const SurfaceTile& tile, const BlockMask& candidate, float band_m,
                                 float cos_limit) noexcept;

}  // namespace felt
