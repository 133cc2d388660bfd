#pragma once

#include <openvdb/openvdb.h>

#include <string>

#include "mapping/map.h"

namespace felt {

/// The state of a map as stock OpenVDB grids, and back. `tsdf_grid`, `weight_grid` and `color_grid` (vdb_views.h) are
/// state as well: their float values give back every plane exactly, colour because 1/256 grey levels are 16 bit.
/// A plane in memory is a leaf in the grid, and the other way round: what is absent stays absent.

/// Observations per voxel of the colour average; a leaf for each block that has colour planes.
openvdb::Int32Grid::Ptr color_count_grid(const Map& map);
/// "evidence/<class>"
std::string evidence_name(const Map& map, int slot);
/// Evidence of one class above its prior; null where no block has a plane of it.
openvdb::FloatGrid::Ptr evidence_grid(const Map& map, int slot);

/// Each adds what a grid holds to the map, creating blocks only for `tsdf`. Throw FormatError where a grid is no leaf
/// for leaf match of the blocks, or carries values outside leaves.
void add_geometry(Map& map, const openvdb::FloatGrid& tsdf, const openvdb::FloatGrid& weight);
void add_color(Map& map, const openvdb::Vec3SGrid& color, const openvdb::Int32Grid& count);
/// Classes in ascending order of slot.
void add_evidence(Map& map, int slot, const openvdb::FloatGrid& evidence);

}  // namespace felt
