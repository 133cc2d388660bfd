#pragma once

#include <array>
#include <cstdint>

#include "mapping/store/region.h"

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

/// Signed distance around a voxel as a linear function, metres and metres a voxel. Along rays that graze the surface it
/// grows by more than a voxel's size a voxel.
struct SurfacePlane {
  float value = 0, x = 0, y = 0, z = 0;
};

/// The plane that fits the 27 voxels around a voxel of the tile (-1 .. 8) best; NaN where some of them were never
/// observed.
SurfacePlane fitted_plane(const SurfaceTile& tile, int at) noexcept;

/// Whether the surface near a voxel at (dx, dy, dz) voxels from the plane's, with signed distance `tsdf_m`, lies within
/// `share` voxels of the plane, measured along its normal: |tsdf - plane| <= share * max(voxel, slope). Never where
/// either is NaN, nor where the distance grows by less than half a voxel a voxel: there it is no surface's.
bool lies_on(const SurfacePlane& plane, int dx, int dy, int dz, float tsdf_m, float voxel_m, float share) noexcept;

/// Direction in which that plane's distance grows fastest, which halves to thirds the noise of central differences.
/// Where some of the 27 were never observed, the mean of what slopes there are along each axis. Zero where there is
/// none.
SurfaceNormal smoothed_normal(const SurfaceTile& tile, int at) noexcept;

/// The voxels of `candidate` (voxels of the band, |tsdf| <= band_m) whose neighbours in the band, of 26, all have
/// smoothed normals n with n . n' >= cos_limit. Rows farther than two from a candidate's are not read.
BlockMask interior_voxels(const SurfaceTile& tile, const BlockMask& candidate, float band_m, float cos_limit) noexcept;
BlockMask interior_voxels_scalar(const SurfaceTile& tile, const BlockMask& candidate, float band_m,
                                 float cos_limit) noexcept;

}  // namespace felt
