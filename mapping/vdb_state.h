#pragma once

#include <openvdb/openvdb.h>

#include <cstdint>
#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt {

/// The state of a map as stock OpenVDB grids. `tsdf_grid`, `weight_grid` and `color_grid` (vdb_views.h) are
/// state as well: their float values give back every plane exactly, colour because 1/256 grey levels are 16 bit.
/// A plane in memory is a leaf in the grid, and the other way round: what is absent stays absent.

/// Which blocks have what, by number, in canonical order: found once for all grids of a map.
struct BlockLists {
  std::vector<uint32_t> color;                  ///< colour planes
  std::vector<std::vector<uint32_t>> evidence;  ///< by slot: a plane of the class
};
BlockLists block_lists(const Map& map);

/// Observations per voxel of the colour average; a leaf for each block that has colour planes.
openvdb::Int32Grid::Ptr color_count_grid(const Map& map, const std::vector<uint32_t>& blocks);
/// "evidence/<class>"
std::string evidence_name(const Map& map, int slot);
/// Evidence of one class above its prior.
openvdb::FloatGrid::Ptr evidence_grid(const Map& map, int slot, const std::vector<uint32_t>& blocks);

}  // namespace felt
