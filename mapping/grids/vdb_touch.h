#pragma once

#include <string>
#include <vector>

#include "mapping/grids/leaf_grid.h"
#include "mapping/touch/property_view.h"

namespace felt {

/// "touch_region/<id>": the grid that holds the region of a touch.
std::string touch_region_name(const Touch& touch);

/// A region as a stock mask grid.
LeafGrid region_grid(const Map& map, Region region, const std::string& name);

/// Stock views for viewers and planners, of a map with labels and properties:
/// * `touched`: a mask; `<property>_mean`, `<property>_sd`: of the next reading, active where the surface has labels or
///   touches and they exist;
/// and, active where a touch of the property reached,
/// * `touch/<property>/{n,mean,m2}`: the readings;
/// * `property/<property>/<class>/{tau,kappa,beta,gamma}`: the moment-matched Normal-Inverse-Gamma blocks, for every
///   class with a prior.
/// `touched`: touch_views(map).
std::vector<LeafGrid> touch_grids(const Map& map, const TouchViews& touched);

}  // namespace felt
