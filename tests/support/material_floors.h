#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/property_table.h"
#include "mapping/map.h"

namespace felt::test {

/// The classes of these floors and, by slot, their places in it.
inline const std::vector<std::string> kMaterials{"concrete", "grass",   "rock", "wood",
                                                 "rubber",   "plastic", "snow", "ice"};
enum Material { concrete, grass, rock, wood, rubber, plastic, snow, ice };

/// One property, friction, with a prior for each of these materials.
PropertyTable friction();

inline constexpr double kFloorVoxel_m = 0.02;
/// A floor at z = 0 of 0.8 m by 0.8 m, of two materials that meet at x = 0, with `counts` observations of the class
/// that vision takes them for.
Map two_floors(int left, int right, float counts);

/// A reading of friction on the floor at (x, y), metres.
TouchRequest reading(double x, double y, double value, double stamp_s = 0, TouchModel model = TouchModel::material);
/// Adds that touch to the map; its id.
uint64_t touch(Map& map, const TouchRequest& request);

}  // namespace felt::test
