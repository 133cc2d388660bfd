#include "mapping/maps/map_verify.h"

#include <catch2/catch.hpp>
#include <functional>
#include <limits>

#include "mapping/touch/touch_update.h"
#include "tests/support/labelled_map.h"
#include "tests/support/random_map.h"

using namespace felt;

TEST_CASE("a sound map has no faults") {
  CHECK(verify(test::random_map({.seed = 8, .blocks = 20, .classes = 4})).empty());
  CHECK(verify(Map(0.02, 0.08)).empty());
}

TEST_CASE("each broken invariant is named with its grid, its count and the voxel") {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto unobserve = [](Map& m, Block& b) {
    b.geometry->weight[100] = 0, b.geometry->tsdf[100] = float(m.truncation_m);
  };
  const auto touch_planes = [](Map& m, Block& b) -> TouchPlanes& {
    Property friction;
    friction.name = "friction";
    m.properties = PropertyTable({friction});
    return b.touch.emplace_back(TouchPlanes{0, m.store.new_plane(), m.store.new_plane(), m.store.new_plane()});
  };
  struct Case {
    const char *grid, *broken;
    std::function<void(Map&, Block&)> harm;
  };
  const Case cases[] = {
      {"weight", "finite", [&](Map&, Block& b) { b.geometry->weight[100] = kNan; }},
      {"weight", ">= 0", [&](Map&, Block& b) { b.geometry->weight[100] = -1; }},
      {"tsdf", "finite", [&](Map&, Block& b) { b.geometry->tsdf[100] = kNan; }},
      {"tsdf", "<= truncation", [&](Map&, Block& b) { b.geometry->tsdf[100] = -0.0801f; }},
      {"tsdf", "nothing was observed",
       [&](Map&, Block& b) { b.geometry->weight[100] = 0, b.geometry->tsdf[100] = 0.01f; }},
      {"color", "not observed",
       [&](Map& m, Block& b) {
         ColorPlanes& c = m.store.add_color(b);
         c.count[100] = 0, c.g[100] = 7;
       }},
      {"color", "255", [&](Map& m, Block& b) { m.store.add_color(b).count[100] = 1, b.color->b[100] = 0xff01; }},
      {"evidence/class 1", ">= 0",
       [&](Map& m, Block& b) {
         b.evidence = {{1, m.store.new_plane()}};
         b.evidence[0].counts->value[100] = -2;
       }},
      {"evidence/class 0", "ascending",
       [&](Map& m, Block& b) {
         b.evidence = {{1, m.store.new_plane()}, {0, m.store.new_plane()}};
       }},
      {"evidence", "in the table",
       [&](Map& m, Block& b) {
         b.evidence = {{9, m.store.new_plane()}};
       }},
      {"evidence/class 1", "observed",
       [&](Map& m, Block& b) {
         unobserve(m, b);
         b.evidence = {{1, m.store.new_plane()}};
         b.evidence[0].counts->value[100] = 2;
       }},
      {"evidence_even", ">= 0", [&](Map& m, Block& b) { (b.even_evidence = m.store.new_plane())->value[100] = -1; }},
      {"evidence_even", "observed",
       [&](Map& m, Block& b) {
         unobserve(m, b);
         (b.even_evidence = m.store.new_plane())->value[100] = 1;
       }},
      {"instance", "votes", [&](Map& m, Block& b) { m.store.add_instance(b).votes[100] = 3; }},
      {"touch", "in the table", [&](Map& m, Block& b) { touch_planes(m, b).property = 1; }},
      {"touch/friction/n", ">= 0", [&](Map& m, Block& b) { touch_planes(m, b).n->value[100] = -1; }},
      {"touch/friction/n", "finite", [&](Map& m, Block& b) { touch_planes(m, b).n->value[100] = kNan; }},
      {"touch/friction/mean", "finite", [&](Map& m, Block& b) { touch_planes(m, b).mean->value[100] = kNan; }},
      {"touch/friction/m2", "finite", [&](Map& m, Block& b) { touch_planes(m, b).m2->value[100] = kNan; }},
  };
  for (const Case& c : cases) {
    Map map = test::random_map({.seed = 8, .blocks = 3, .classes = 2});
    Block& block = map.store[map.store.sorted()[1]];
    block.evidence.clear();
    c.harm(map, block);
    const std::vector<MapFault> faults = verify(map);
    INFO(c.grid << ": " << c.broken);
    REQUIRE_FALSE(faults.empty());
    CHECK(faults[0].grid == c.grid);
    CHECK_THAT(faults[0].broken, Catch::Matchers::Contains(c.broken));
    CHECK(faults[0].voxels == 1);
    CHECK(block_of_voxel(faults[0].first) == block.coord);
  }
}

TEST_CASE("a touched map is sound, and each way to break its touches is named") {
  const auto touched = [] { return test::touched_floor([](const Eigen::Vector3d&) { return 1; }); };
  CHECK(verify(touched()).empty());
  const auto broken = [](const Map& map, const std::string& grid) {
    for (const MapFault& fault : verify(map))
      if (fault.grid == grid) return fault.voxels > 0;
    return false;
  };
  Map map = touched();
  map.touches.touches[0].region.append({1000, 0, 0}, map.touches.touches[0].region.mask[0]);
  CHECK(broken(map, "touch_region/" + id_text(map.touches.touches[0].id)));
  map = touched();
  map.touches.touches[0].region = {};
  CHECK(broken(map, "touch_region/" + id_text(map.touches.touches[0].id)));
  map = touched();
  const Block* with_touch = nullptr;
  for (const Block& block : map.store.blocks())
    if (!block.touch.empty()) with_touch = &block;
  REQUIRE(with_touch != nullptr);
  with_touch->touch[0].m2->value[3] = -1;
  CHECK(broken(map, "touch/friction/m2"));
  map = touched();
  // What is wrong with the counts is wrong with the belief, too.
  map.touches.touches[0].request.model = TouchModel::mixture;
  test::add_evidence(map, map.touches.touches[0].voxel, 1, std::numeric_limits<float>::infinity());
  CHECK(broken(map, "evidence/ice"));
  CHECK(broken(map, "alpha"));
}
