#pragma once

#include <Eigen/Geometry>

#include "mapping/map.h"

namespace felt {

/// A map of the voxels whose centres lie in the box (world frame, metres, bounds included): geometry, colour and class
/// counts. Voxels outside are unobserved in it.
Map cropped(const Map& map, const Eigen::AlignedBox3d& box_m);

/// Smallest box that holds the centres of all observed voxels, metres; empty for an empty map.
Eigen::AlignedBox3d observed_bounds(const Map& map);

}  // namespace felt
