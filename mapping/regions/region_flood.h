#pragma once

#include "mapping/map.h"
#include "mapping/regions/region_surface.h"
#include "mapping/store/region.h"

namespace felt {

/// The `connected` region around a contact's voxel: grows block by block through interior voxels and ends with the
/// candidates that lie on their planes (region_surface.h). Empty where the voxel is not of its own surroundings.
/// Deterministic, whatever the order of growth; blocks are examined in parallel.
Region flood_region(const Map& map, const SurfaceRule& rule, const Index3& seed);

/// Keeps the voxels of a connected region within `radius_voxels` of the seed along the region (Dijkstra over
/// 26-neighbours with steps 1, sqrt 2, sqrt 3; an overestimate of the geodesic by at most 8 %). The seed is in it.
Region within_geodesic(const Region& region, const Index3& seed, double radius_voxels);

}  // namespace felt
