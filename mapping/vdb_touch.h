#pragma once

#include <openvdb/openvdb.h>

#include <functional>
#include <string>
#include <vector>

#include "mapping/map.h"
#include "mapping/property_view.h"

namespace felt {

/// "touch_region/<id>": the grid that holds the region of a touch.
std::string touch_region_name(const Touch& touch);

/// A region as a stock mask grid, and back.
openvdb::MaskGrid::Ptr region_grid(const Map& map, const Region& region, const std::string& name);
Region region_of(const openvdb::MaskGrid& grid);

/// Stock views for viewers and planners, of a map with labels and properties:
/// * `touched`: a mask; `<property>_mean`, `<property>_sd`: of the next reading, active where the surface has labels or
///   touches and they exist;
/// and, active where a touch of the property reached,
/// * `touch/<property>/{n,mean,m2}`: the readings;
/// * `property/<property>/<class>/{tau,kappa,beta,gamma}`: the moment-matched Normal-Inverse-Gamma blocks, for every
///   class with a prior.
/// One call for each grid, so that no more than one has to be in memory; the map must outlive them and stay as it is.
/// `touched`: touch_views(map).
struct NamedGrid {
  std::string name;
  std::function<openvdb::GridBase::Ptr()> make;
};
std::vector<NamedGrid> touch_grids(const Map& map, TouchViews touched);

}  // namespace felt
