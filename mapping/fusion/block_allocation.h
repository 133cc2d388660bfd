#pragma once

#include <cstdint>
#include <vector>

#include "core/frame.h"
#include "mapping/fusion/depth_tiles.h"
#include "mapping/map.h"

namespace felt {

/// What was found in the last frame; its memory is used again for the next.
struct AllocationScratch {
  DepthTiles tiles;  ///< of the usable depth
  std::vector<uint8_t> cells;
  std::vector<float> offsets_m;
};

/// Whether all within `reach_m` of a camera has a place on the map: index coordinates are 32-bit. Elsewhere
/// `blocks_in_view` finds none.
bool on_map(const Eigen::Isometry3d& T_world_camera, double voxel_size_m, double reach_m);

/// Coordinates, ascending, of the blocks that hold a voxel within the truncation of a measured surface. Rays of every
/// n-th pixel are sampled at most half a block apart along and a quarter of a block across the ray (1 <= n <= 4), into
/// a box of one byte a block around the view: time and memory do not depend on the size of the map. The same pass over
/// the image fills `scratch.tiles`.
std::vector<BlockCoord> blocks_in_view(const DepthImage& depth_m, const PinholeCamera& camera,
                                       const Eigen::Isometry3d& T_world_camera, double voxel_size_m,
                                       double truncation_m, float min_depth_m, float max_depth_m,
                                       AllocationScratch& scratch);

}  // namespace felt
