#pragma once

#include "mapping/map.h"
#include "mapping/store/region.h"
#include "mapping/store/region_settings.h"

namespace felt {

/// Area of the surface within a region, square metres: of the edges between face neighbours that the surface crosses
/// (the nearer end within the region), each stands for |n_axis| voxel faces, n being the unit normal. A plane crosses
/// |n_axis| edges along an axis in each face's area, and the squares of a normal's parts sum to 1 (Cauchy's and
/// Crofton's formulas): exact for planes however they lie to the grid, and however steeply distance along rays rises.
double surface_area_m2(const Map& map, const Region& region, const RegionSettings& settings);

}  // namespace felt
