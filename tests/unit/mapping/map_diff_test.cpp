#include "mapping/maps/map_diff.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <functional>
#include <limits>

#include "mapping/touch/touch_update.h"
#include "mapping/touch/touch_view.h"
#include "tests/support/labelled_map.h"
#include "tests/support/random_map.h"
#include "tests/support/voxel_where.h"

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

TEST_CASE("one changed value of each kind of plane is found, in its channel and unit, and in no other") {
  const auto make = [] {
    return random_map({.seed = 2, .blocks = 12, .classes = 3, .shared_evidence = true, .instances = true});
  };
  struct Case {
    const char* channel;
    double difference;
    std::function<void(Block&, int)> change;
  };
  // A colour is stored in 1/256 grey levels. By one bit or downwards, so that no number wraps around.
  const Case cases[] = {
      {"color", 2, [](Block& b, int i) { b.color->r[i] ^= 512; }},
      {"color", 2, [](Block& b, int i) { b.color->g[i] ^= 512; }},
      {"color", 2, [](Block& b, int i) { b.color->b[i] ^= 512; }},
      {"color_count", 1, [](Block& b, int i) { b.color->count[i] ^= 1; }},
      {"evidence_even", 0.0625, [](Block& b, int i) { b.even_evidence->value[i] -= 0.0625f; }},
      {"instance", 1, [](Block& b, int i) { b.instance->id[i] ^= 4; }},
      {"instance_votes", 1, [](Block& b, int i) { b.instance->votes[i] -= 1; }},
      {"weight", 0.5, [](Block& b, int i) { b.geometry->weight[i] = b.geometry->weight[i] + 0.5f; }},
  };
  const Map a = make();
  for (const Case& c : cases) {
    Map b = make();
    const test::VoxelAt voxel = test::voxel_with_everything(b);
    c.change(voxel.block, voxel.offset);
    const MapDifference d = difference(a, b);
    INFO(c.channel);
    CHECK_FALSE(d.same_hash);
    CHECK(channel(d, c.channel).max_difference == Approx(c.difference).epsilon(1e-5));
    CHECK(beyond(d, 0));
    CHECK(beyond(d, 0.99 * c.difference));
    // Ids are names: no tolerance makes two of them equal.
    CHECK(beyond(d, 1.01 * c.difference) == (std::string(c.channel) == "instance"));
    for (const ChannelDifference& other : d.channels) {
      INFO(other.name);
      CHECK(other.voxels_changed == (other.name == c.channel ? 1 : 0));
      CHECK(other.voxels_only_a + other.voxels_only_b == 0);
    }
  }
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

TEST_CASE("a flip is told from priors and touches too, as in the grid of labels") {
  const auto wooden = [] { return test::floor_of_wood_and_ice([](const Eigen::Vector3d&) { return 0; }, 0.02, 1); };
  const Map before = wooden();
  Map touched = wooden();
  for (int i = 0; i < 8; ++i) {
    TouchRequest r;
    r.point_m = {0, 0, 0};
    r.property = "friction";
    r.value = 0.1;
    r.stamp_s = i;
    add_touch(touched, resolve_touch(touched, r));
  }
  // Every voxel that a touch speaks for and that vision called wood.
  const std::vector<TouchView> views = touch_views(touched);
  size_t flipped = 0;
  for (const TouchView& view : views)
    for (int i = 0; i < kBlockVoxels; ++i)
      if (view.mask.test(i))
        if (const Block* block = before.store.get(view.coord);
            block != nullptr && class_belief(*block, i, before.classes).slot == 0)
          flipped += view.label[size_t(i)] == 1;
  REQUIRE(flipped > 100);
  CHECK(difference(before, touched).class_flips == flipped);
  CHECK(difference(touched, touched).class_flips == 0);

  // Ice has so great a prior that one observation of wood does not outweigh it.
  Map icy = wooden();
  std::vector<ClassInfo> classes = icy.classes.classes();
  for (ClassInfo& c : classes)
    if (c.name == "ice") c.prior = 5;
  icy.classes = ClassTable(classes);
  const MapDifference d = difference(before, icy);
  CHECK(d.same_hash);
  CHECK(d.class_flips > 100);
}

TEST_CASE("where tables differ, the first difference is named") {
  Map a(0.02, 0.08), b(0.02, 0.08);
  a.classes = ClassTable({{1, "wood", {}, false}, {2, "grass", {}, false}});
  b.classes = ClassTable({{1, "wood", {}, false}, {3, "ice", {}, false}});
  Property friction, stiffness;
  friction.name = "friction";
  stiffness.name = "stiffness";
  a.properties = PropertyTable({friction});
  b.properties = PropertyTable({friction, stiffness});
  std::vector<std::string> lines = difference(a, b).settings;
  REQUIRE(lines.size() == 2);
  CHECK_THAT(lines[0], Catch::Matchers::Contains("row 2 is 'grass' (id 2) and 'ice' (id 3)"));
  CHECK_THAT(lines[1], Catch::Matchers::Contains("only one has 'stiffness'"));
  b.classes = ClassTable({{1, "wood", {}, false, 3}, {2, "grass", {}, false}});
  friction.priors["wood"] = {0.3, 0.1, 4};
  b.properties = PropertyTable({friction});
  lines = difference(a, b).settings;
  REQUIRE(lines.size() == 2);
  CHECK_THAT(lines[0], Catch::Matchers::Contains("'wood' (id 1) has another prior"));
  CHECK_THAT(lines[1], Catch::Matchers::Contains("'friction' has other priors"));
}

TEST_CASE("maps of another voxel size are different without comparing voxels") {
  const MapDifference d = difference(Map(0.02, 0.08), Map(0.020000001, 0.08));
  CHECK_FALSE(d.comparable);
  REQUIRE(d.settings.size() == 1);
  CHECK(d.settings[0] == "voxel_size_m: 0.02 and 0.020000001");
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
  const auto request = [](double x) {
    TouchRequest r;
    r.point_m = {x, 0, 0};
    r.property = "friction";
    r.value = 0.3;
    return r;
  };
  const auto floor = [] { return test::floor_of_wood_and_ice(test::wood_then_ice); };
  const Map untouched = floor();
  Map a = floor(), b = floor();
  add_touch(a, resolve_touch(a, request(-0.1)));
  MapDifference d = difference(untouched, a);
  CHECK(d.touches_only_b == 1);
  CHECK(channel(d, "touch/friction/n").voxels_only_b > 100);
  CHECK(beyond(d, 1e9));
  CHECK_FALSE(beyond(difference(a, a), 0));
  CHECK(difference(a, a).touches_both == 1);
  // Undone, it counts nowhere, but one of the files has it.
  Map undone = floor();
  undo_touch(undone, add_touch(undone, resolve_touch(undone, request(-0.1))));
  d = difference(untouched, undone);
  CHECK(d.same_hash);
  CHECK(d.undone_only_b == 1);
  CHECK(d.undone_only_a == 0);
  CHECK_FALSE(beyond(d, 0));
  CHECK(difference(undone, undone).undone_only_a == 0);

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
