#include "mapping/maps/map_diff.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "mapping/touch/touch_update.h"
#include "tests/support/labelled_map.h"
#include "tests/support/random_map.h"

using namespace felt;
using test::random_map;

namespace {

const ChannelDifference& channel(const MapDifference& d, const std::string& name) {
  for (const ChannelDifference& c : d.channels)
    if (c.name == name) return c;
  throw std::runtime_error("no channel " + name);
}

Block& first_block(Map& map) { return map.store[map.store.sorted().front()]; }

}  // namespace

TEST_CASE("a map does not differ from itself") {
  const Map map = random_map({.seed = 2, .blocks = 12, .classes = 3});
  const MapDifference d = difference(map, random_map({.seed = 2, .blocks = 12, .classes = 3}));
  CHECK(d.same_hash);
  CHECK(d.settings.empty());
  CHECK(d.blocks_both == 12);
  CHECK(d.channels.size() == 7);
  for (const ChannelDifference& c : d.channels) {
    CHECK(c.voxels_both > 0);
    CHECK(c.voxels_changed == 0);
    CHECK(c.max_difference == 0);
  }
  CHECK_FALSE(beyond(d, 0));
}

TEST_CASE("a difference is found in the channel and by the amount that was changed") {
  const auto make = [] { return random_map({.seed = 2, .blocks = 12, .classes = 3}); };
  const Map a = make();
  Map b = make();
  Block& block = first_block(b);
  block.geometry->tsdf[100] += 0.25f;
  const MapDifference d = difference(a, b);
  CHECK_FALSE(d.same_hash);
  CHECK(channel(d, "tsdf").voxels_changed == 1);
  CHECK(channel(d, "tsdf").max_difference == Approx(0.25).epsilon(1e-5));
  CHECK(channel(d, "tsdf").mean_difference ==
        Approx(channel(d, "tsdf").max_difference / double(channel(d, "tsdf").voxels_both)));
  CHECK(channel(d, "weight").voxels_changed == 0);
  CHECK(beyond(d, 0.2));
  CHECK_FALSE(beyond(d, 0.3));
}

TEST_CASE("a value that is not a number in one map only is beyond every tolerance") {
  const Map a = random_map({.seed = 2, .blocks = 2});
  Map b = random_map({.seed = 2, .blocks = 2});
  first_block(b).geometry->tsdf[100] = std::numeric_limits<float>::quiet_NaN();
  CHECK(std::isinf(channel(difference(a, b), "tsdf").max_difference));
  CHECK(beyond(difference(a, b), 1e30));
  Map c = random_map({.seed = 2, .blocks = 2});
  first_block(c).geometry->weight[100] = std::numeric_limits<float>::quiet_NaN();
  CHECK(beyond(difference(a, c), 1e30));
}

TEST_CASE("voxels and blocks with values in one map only are counted on their side, whatever the tolerance") {
  const Map a = random_map({.seed = 2, .blocks = 2});
  Map b = random_map({.seed = 2, .blocks = 2});
  b.store[b.store.find_or_create({90, 0, 0})].geometry->weight[3] = 1;
  b.store.find_or_create({91, 0, 0});  // holds nothing: not part of the map
  const MapDifference d = difference(a, b);
  CHECK(d.blocks_only_b == 1);
  CHECK(d.blocks_only_a == 0);
  CHECK(channel(d, "weight").voxels_only_b == 1);
  CHECK(channel(difference(b, a), "weight").voxels_only_a == 1);
  CHECK(beyond(d, 1e9));
}

TEST_CASE("classes are compared by name, and a flip is a voxel whose leading class has another one") {
  Map a(0.02, 0.08), b(0.02, 0.08);
  a.classes = ClassTable({{1, "wood", {}, false}, {2, "grass", {}, false}});
  b.classes = ClassTable({{2, "grass", {}, false}, {1, "wood", {}, false}});
  for (Map* map : {&a, &b}) {
    Block& block = map->store[map->store.find_or_create({0, 0, 0})];
    for (const uint16_t slot : {0, 1}) block.evidence.push_back({slot, map->store.new_plane()});
    for (int i = 0; i < 3; ++i) block.geometry->weight[i] = 1;
    block.evidence[0].counts->value[0] = 5;
  }
  // Slot 0 is wood in a and grass in b.
  CHECK(difference(a, b).class_flips == 1);
  CHECK(channel(difference(a, b), "evidence/wood").voxels_only_a == 1);
  CHECK(channel(difference(a, b), "evidence/grass").voxels_only_b == 1);
  CHECK_FALSE(difference(a, b).settings.empty());
}

TEST_CASE("maps of another voxel size are different without comparing voxels") {
  const MapDifference d = difference(Map(0.02, 0.08), Map(0.01, 0.08));
  CHECK_FALSE(d.comparable);
  REQUIRE(d.settings.size() == 1);
  CHECK_THAT(d.settings[0], Catch::Matchers::Contains("voxel_size_m"));
  CHECK(beyond(d, 1e9));
}

TEST_CASE("maps with equal values and other journals are equal, and the journals are mentioned") {
  Map a = random_map({.seed = 2, .blocks = 2}), b = random_map({.seed = 2, .blocks = 2});
  record_frame(b.frames, "other", "", 7);
  const MapDifference d = difference(a, b);
  CHECK(d.same_hash);
  CHECK(d.settings.size() == 1);
  CHECK_FALSE(beyond(d, 0));
}

TEST_CASE("touches that only one map has, and regions that differ, are beyond every tolerance") {
  const auto wall = [] {
    Map map = test::labelled_map(
        0.02, {-0.2, -0.2, -0.1}, {0.2, 0.2, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
        test::class_table({"wood", "ice"}), [](const Eigen::Vector3d& p) { return p.x() < 0 ? 0 : 1; });
    Property friction;
    friction.name = "friction";
    friction.priors = {{"wood", {0.4, 0.05, 50}}, {"ice", {0.1, 0.05, 50}}};
    map.properties = PropertyTable({friction});
    return map;
  };
  const auto request = [](double x) {
    TouchRequest r;
    r.point_m = {x, 0, 0};
    r.property = "friction";
    r.value = 0.3;
    return r;
  };
  const Map untouched = wall();
  Map a = wall(), b = wall();
  add_touch(a, resolve_touch(a, request(-0.1)));
  MapDifference d = difference(untouched, a);
  CHECK(d.touches_only_b == 1);
  CHECK(channel(d, "touch/friction/n").voxels_only_b > 100);
  CHECK(beyond(d, 1e9));
  CHECK_FALSE(beyond(difference(a, a), 0));
  CHECK(difference(a, a).touches_both == 1);

  Touch smaller = resolve_touch(b, request(-0.1));
  const size_t voxels = smaller.region.voxels();
  smaller.region.mask[0] = {};
  smaller.region.mask[0].set(offset_in_block(smaller.voxel));
  add_touch(b, smaller);
  d = difference(a, b);
  CHECK(d.touches_both == 1);
  CHECK(d.regions_changed == 1);
  CHECK(d.region_voxels_changed >= voxels - smaller.region.voxels());
  CHECK(beyond(d, 1e9));
}
