#pragma once

#include <openvdb/openvdb.h>

#include "mapping/map.h"

namespace felt {

/// Stock OpenVDB views of the map. `tsdf` is a level set in metres with background = truncation; voxels are active
/// where weight > 0, and both grids have the same topology.
openvdb::FloatGrid::Ptr tsdf_grid(const Map& map);
openvdb::FloatGrid::Ptr weight_grid(const Map& map);
openvdb::Vec3SGrid::Ptr color_grid(const Map& map);  ///< in [0, 1]

}  // namespace felt
