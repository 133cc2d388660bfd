#pragma once

#include <openvdb/openvdb.h>

#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt {

/// "touch_region/<id>": the grid that holds the region of a touch.
std::string touch_region_name(const Touch& touch);

/// A region as a stock mask grid, and back.
openvdb::MaskGrid::Ptr region_grid(const Map& map, const Region& region, const std::string& name);
Region region_of(const openvdb::MaskGrid& grid);

/// Stock views of what touches left: `touch/<property>/{n,mean,m2}` (active where n > 0), `touched`, and where touched
/// `<property>_mean` and `<property>_sd` (of the next reading; active where they exist). Empty without touches.
std::vector<openvdb::GridBase::Ptr> touch_grids(const Map& map);

}  // namespace felt
