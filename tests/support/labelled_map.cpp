#include "tests/support/labelled_map.h"

#include <algorithm>
#include <cmath>

#include "mapping/touch/touch_update.h"

namespace felt::test {

ClassTable class_table(const std::vector<std::string>& names) {
  std::vector<ClassInfo> rows{{0, "none", {}, true}};
  for (size_t i = 0; i < names.size(); ++i)
    rows.push_back({uint16_t(i + 1), names[i], default_class_color(int(i)), false});
  return ClassTable(rows);
}

void add_evidence(Map& map, const Index3& voxel, int slot, float count) {
  Block& block = map.store[map.store.find(block_of_voxel(voxel))];
  auto at = std::lower_bound(block.evidence.begin(), block.evidence.end(), slot,
                             [](const EvidencePlane& e, int s) { return e.slot < s; });
  if (at == block.evidence.end() || at->slot != slot)
    at = block.evidence.insert(at, EvidencePlane{uint16_t(slot), map.store.new_plane()});
  at->counts->value[offset_in_block(voxel)] += count;
}

double total_evidence(const Block& block, int offset) {
  double total = block.even_evidence == nullptr ? 0 : double(block.even_evidence->value[offset]);
  for (const EvidencePlane& plane : block.evidence) total += double(plane.counts->value[offset]);
  return total;
}

Map labelled_map(double voxel_size_m, const Eigen::Vector3d& lo, const Eigen::Vector3d& hi, const SignedDistance& sdf,
                 const ClassTable& classes, const LabelAt& label_at, float counts) {
  Map map(voxel_size_m, 4 * voxel_size_m);
  map.classes = classes;
  const auto index = [&](double x) { return int32_t(std::lround(x / voxel_size_m)); };
  for (int32_t x = index(lo.x()); x <= index(hi.x()); ++x)
    for (int32_t y = index(lo.y()); y <= index(hi.y()); ++y)
      for (int32_t z = index(lo.z()); z <= index(hi.z()); ++z) {
        const Eigen::Vector3d p = Eigen::Vector3d(x, y, z) * voxel_size_m;
        const double d = sdf(p);
        if (std::abs(d) > map.truncation_m) continue;
        Block& block = map.store[map.store.find_or_create(block_of_voxel({x, y, z}))];
        block.geometry->tsdf[offset_in_block({x, y, z})] = float(d);
        block.geometry->weight[offset_in_block({x, y, z})] = 5;
        if (const int slot = label_at(p); slot >= 0 && std::abs(d) <= 1.5 * voxel_size_m)
          add_evidence(map, {x, y, z}, slot, counts);
      }
  return map;
}

Map floor_of_wood_and_ice(const LabelAt& label_at, double prior_sd, float counts) {
  Map map = labelled_map(
      0.02, {-0.2, -0.2, -0.1}, {0.2, 0.2, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
      class_table({"wood", "ice"}), label_at, counts);
  Property friction;
  friction.name = "friction";
  friction.priors = {{"wood", {0.4, prior_sd, 50}}, {"ice", {0.1, prior_sd, 50}}};
  map.properties = PropertyTable({friction});
  return map;
}

int wood_then_ice(const Eigen::Vector3d& p) { return p.x() < 0 ? 0 : 1; }

Map touched_floor(const LabelAt& label_at) {
  Map map = floor_of_wood_and_ice(label_at);
  TouchRequest request;
  request.property = "friction";
  request.value = 0.3;
  add_touch(map, resolve_touch(map, request));
  return map;
}

}  // namespace felt::test
