#include "mapping/grids/vdb_touch.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <map>
#include <memory>
#include <string>

#include "mapping/touch/touch_update.h"
#include "tests/support/labelled_map.h"

using namespace felt;
using namespace felt::test;

namespace {

/// A floor of snow (x < 0) and wood with two properties; stiffness is known of wood only.
Map two_floors() {
  Map map = labelled_map(
      0.02, {-0.2, -0.2, -0.1}, {0.2, 0.2, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
      class_table({"wood", "snow", "ice"}), [](const Eigen::Vector3d& p) { return p.x() < 0 ? 1 : 0; }, 12.5f);
  Property friction, stiffness;
  friction.name = "friction";
  friction.priors = {{"wood", {0.372, 0.055, 50}}, {"snow", {0.39, 0.071, 50}}, {"ice", {0.192, 0.046, 50}}};
  stiffness.name = "stiffness";
  stiffness.priors = {{"wood", {9000, 1200, 20}}};
  map.properties = PropertyTable({friction, stiffness});
  return map;
}

void touch(Map& map, double x, const std::string& property, double value, TouchModel model, double stamp_s) {
  TouchRequest request;
  request.stamp_s = stamp_s;
  request.point_m = {x, 0.02, 0};
  request.property = property;
  request.value = value;
  request.model = model;
  add_touch(map, resolve_touch(map, request));
}

std::map<std::string, openvdb::GridBase::Ptr> grids_of(const Map& map) {
  openvdb::initialize();
  std::map<std::string, openvdb::GridBase::Ptr> grids;
  const auto touched = std::make_shared<const std::vector<TouchView>>(touch_views(map));
  for (const LeafGrid& grid : touch_grids(map, touched)) grids[grid.name] = stock_grid(grid);
  for (const auto& [name, grid] : grids) CHECK(grid->getName() == name);
  return grids;
}

}  // namespace

TEST_CASE("property grids of a stock file answer as the map does, touched or not") {
  Map map = two_floors();
  touch(map, -0.1, "friction", 0.17, TouchModel::material, 1);
  touch(map, -0.1, "friction", 0.21, TouchModel::material, 2);
  touch(map, 0.1, "friction", 0.4, TouchModel::mixture, 3);
  touch(map, 0.1, "stiffness", 8000, TouchModel::material, 4);
  const auto grids = grids_of(map);
  Beliefs beliefs(map);
  const auto value = [&](const std::string& name, const Index3& v) {
    const auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(grids.at(name));
    return double(grid->tree().getValue({v.x, v.y, v.z}));
  };
  const auto active = [&](const std::string& name, const Index3& v) {
    return grids.contains(name) &&
           openvdb::gridPtrCast<openvdb::FloatGrid>(grids.at(name))->tree().isValueOn({v.x, v.y, v.z});
  };
  // Touched snow, touched wood (both models), and the band's edge that no region holds.
  for (const Index3 v : {Index3{-5, 1, 0}, Index3{-5, -3, 1}, Index3{5, 1, 0}, Index3{5, 4, -1}}) {
    const Belief belief = beliefs.at(v);
    INFO(v.x << " " << v.y << " " << v.z);
    for (const size_t p : {size_t(0), size_t(1)}) {
      const std::string name = map.properties[int(p)].name;
      CHECK(value(name + "_mean", v) == Approx(*mean(belief.next_reading[p])).epsilon(1e-5));
      CHECK(value(name + "_sd", v) == Approx(std::sqrt(*variance(belief.next_reading[p]))).epsilon(1e-4));
    }
    for (int c = 0; c < map.classes.size(); ++c) {
      const std::string name = "property/friction/" + map.classes.at_slot(c).name + "/";
      const Nig& nig = belief.nig[0][size_t(c)];
      CHECK(value(name + "tau", v) == Approx(nig.tau).epsilon(1e-5));
      CHECK(value(name + "kappa", v) == Approx(nig.kappa).epsilon(1e-4));
      CHECK(value(name + "beta", v) == Approx(nig.beta).epsilon(1e-4));
      CHECK(value(name + "gamma", v) == Approx(nig.gamma).epsilon(1e-4));
    }
    const bool on_wood = v.x > 0;
    CHECK(active("property/stiffness/wood/tau", v) == on_wood);
    CHECK(value("touch/friction/n", v) == (on_wood ? 1 : 2));
    CHECK(value("touch/friction/mean", v) == Approx(on_wood ? 0.4 : 0.19).epsilon(1e-6));
    CHECK(value("touch/friction/m2", v) == Approx(on_wood ? 0 : 0.0008).margin(1e-8));
  }
  CHECK(grids.count("property/stiffness/snow/tau") == 0);
  CHECK(grids.at("touched")->activeVoxelCount() ==
        united(map.touches.touches[0].region, map.touches.touches[2].region).voxels());
}

TEST_CASE("an untouched map shows its priors where it has labels, and no readings") {
  Map map = two_floors();
  const auto grids = grids_of(map);
  CHECK(grids.size() == 5);  // touched, and mean and sd of two properties
  CHECK(grids.at("touched")->empty());
  const auto mean_grid = openvdb::gridPtrCast<openvdb::FloatGrid>(grids.at("friction_mean"));
  Beliefs beliefs(map);
  size_t labelled = 0;
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      const Index3 f = first_voxel(block.coord), o = voxel_of_offset(i), v{f.x + o.x, f.y + o.y, f.z + o.z};
      float evidence = 0;
      for (const EvidencePlane& e : block.evidence) evidence += e.counts->value[i];
      REQUIRE(mean_grid->tree().isValueOn({v.x, v.y, v.z}) == (evidence > 0));
      if (evidence > 0 && ++labelled % 97 == 0)
        CHECK(double(mean_grid->tree().getValue({v.x, v.y, v.z})) ==
              Approx(*mean(beliefs.at(v).next_reading[0])).epsilon(1e-5));
    }
  CHECK(labelled > 500);
  map.properties = PropertyTable();
  CHECK(grids_of(map).empty());
}
