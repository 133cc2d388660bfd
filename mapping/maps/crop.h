#pragma once

#include <Eigen/Geometry>

#include "mapping/map.h"
#include "mapping/store/region.h"

namespace felt {

/// The observed voxels whose centres lie in a box (world frame, metres, bounds included).
Region voxels_in(const Map& map, const Eigen::AlignedBox3d& box_m);
/// The observed voxels whose most probable class is that of a slot, touches counted.
Region voxels_of_class(const Map& map, int slot);

/// A map of the observed voxels of a region: geometry, colour, class counts, tables, and the frames that they were
/// made of, and what of the touches' regions lies in it. All others are unobserved in it.
Map cropped(const Map& map, const Region& region);

/// Smallest box that holds the centres of all observed voxels, metres; empty for an empty map.
Eigen::AlignedBox3d observed_bounds(const Map& map);

}  // namespace felt
