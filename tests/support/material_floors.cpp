#include "tests/support/material_floors.h"

#include "mapping/touch/touch_update.h"
#include "tests/support/labelled_map.h"

namespace felt::test {

PropertyTable friction() {
  Property p;
  p.name = "friction";
  p.support_lo = 0;
  p.priors = {{"concrete", {0.543, 0.065, 50}}, {"grass", {0.577, 0.077, 50}},  {"rock", {0.478, 0.133, 50}},
              {"wood", {0.372, 0.055, 50}},     {"rubber", {0.616, 0.048, 50}}, {"plastic", {0.311, 0.045, 50}},
              {"snow", {0.390, 0.071, 50}},     {"ice", {0.192, 0.046, 50}}};
  return PropertyTable({p});
}

Map two_floors(int left, int right, float counts) {
  Map map = labelled_map(
      kFloorVoxel_m, {-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
      class_table(kMaterials), [&](const Eigen::Vector3d& p) { return p.x() < 0 ? left : right; }, counts);
  map.properties = friction();
  return map;
}

TouchRequest reading(double x, double y, double value, double stamp_s, TouchModel model) {
  TouchRequest request;
  request.stamp_s = stamp_s;
  request.point_m = {x, y, 0};
  request.property = "friction";
  request.value = value;
  request.model = model;
  return request;
}

uint64_t touch(Map& map, const TouchRequest& request) { return add_touch(map, resolve_touch(map, request)); }

}  // namespace felt::test
