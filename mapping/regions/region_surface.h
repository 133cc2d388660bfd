#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "mapping/map.h"
#include "mapping/store/region.h"

namespace felt {

struct FittedNormal;

/// What makes a voxel a candidate of a region, resolved to numbers of the map.
struct SurfaceRule {
  float band_m = 0;
  float min_weight = 1;
  uint16_t instance = 0;     ///< thing to belong to; 0: things do not matter
  int slot = -1;             ///< class to agree with; -1: classes do not matter
  float class_ratio = 0;     ///< see RegionSettings
  std::vector<float> prior;  ///< concentrations by slot
  bool limit_color = false;  ///< whether `color` and `color_change` count
  float color[3] = {0, 0, 0};
  float color_change = 0;
  float cos_normal_change = -1;
  float voxel_m = 0;
  Index3 centre;  ///< of the Euclidean limit
  float radius_voxels = std::numeric_limits<float>::infinity();
};

/// Candidates of one block, and those that the region may grow through.
struct BlockSurface {
  BlockMask candidate;
  BlockMask interior;  ///< candidates whose neighbours in the band all have normals within the limit of theirs
};

/// Voxels of the block in the surface band (no other limit).
BlockMask surface_band(const Block& block, float band_m, float min_weight);

/// Band, class, colour and radius limits; the specification of `connected`'s candidates.
BlockMask candidates(const Block& block, const SurfaceRule& rule);

/// A block and its neighbours, null where there is none: entry 9 (dx + 1) + 3 (dy + 1) + dz + 1 lies at offset (dx, dy,
/// dz), entry 13 is the block itself.
using BlockNeighbours = std::array<const Block*, 27>;

/// Reads the block and its neighbours; blocks may be examined in parallel.
BlockSurface examine_block(const BlockNeighbours& near, const SurfaceRule& rule);

/// How far, in voxels along each axis, a voxel that ends a region may be from one that the region grows through.
constexpr int kCollar = 2;

/// Of the voxels in `open` (by neighbour, null for none), those within kCollar voxels of a voxel of the block in
/// `grown` whose plane they lie on: `lies_on` its `fitted_plane` (mapping/regions/interior_kernels.h).
std::array<BlockMask, 27> on_planes_of(const BlockNeighbours& near, const BlockMask& grown,
                                       const std::array<const BlockMask*, 27>& open, const SurfaceRule& rule);

/// How noisy the surface is around a voxel: the median angle, degrees, between the normals of face neighbours of the
/// band within eight voxels of it (those ahead of every other voxel). 0 where there are none.
double normal_noise_deg(const Map& map, const Index3& centre, const SurfaceRule& rule);

/// Unit normal of the plane that fits the surface within eight voxels of a voxel best (least squares), where its own
/// normals are less than 45 degrees off `along`, a unit vector: an edge nearby does not turn it. `along` where no plane
/// fits.
FittedNormal fitted_normal(const Map& map, const Index3& centre, const Eigen::Vector3d& along, const SurfaceRule& rule);

/// Unit normal of the surface at a voxel, towards free space: `smoothed_normal` (mapping/regions/interior_kernels.h).
/// Zero where there is none.
Eigen::Vector3f surface_normal(const Map& map, const Index3& voxel, float min_weight);

}  // namespace felt
