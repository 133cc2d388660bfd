#include "mapping/store/block_store.h"

#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <string>

#include "mapping/grids/vdb_state.h"
#include "mapping/map.h"
#include "mapping/touch/touch_update.h"
#include "tests/support/random_map.h"
#include "tests/support/voxel_where.h"

using namespace felt;

TEST_CASE("a block store finds exactly the blocks that were created, negative coordinates included") {
  BlockStore store(0.08f);
  std::vector<BlockCoord> coords;
  for (int x = -9; x < 9; ++x)
    for (int y = -7; y < 7; ++y)
      for (int z = -5; z < 5; ++z)
        if ((x * 7 + y * 5 + z) % 3 == 0) coords.push_back({x, y, z});
  for (const auto& c : coords) store.find_or_create(c);
  REQUIRE(store.size() == coords.size());
  for (uint32_t i = 0; i < coords.size(); ++i) {
    REQUIRE(store.find(coords[i]) == i);
    REQUIRE(store.find_or_create(coords[i]) == i);
  }
  CHECK(store.find({100, 0, 0}) == BlockStore::kNone);
  CHECK(store.get({-9, -7, 5}) == nullptr);
  CHECK(store[0].geometry->tsdf[511] == 0.08f);
  CHECK(store[0].geometry->weight[0] == 0.0f);
}

TEST_CASE("the map hash ignores creation order and empty blocks, and sees every value") {
  const auto fill = [](Map& map, BlockCoord c, float value) {
    Block& b = map.store[map.store.find_or_create(c)];
    b.geometry->tsdf[17] = value;
    b.geometry->weight[17] = 1;
  };
  Map first(0.02, 0.08), second(0.02, 0.08), third(0.02, 0.08);
  fill(first, {1, 2, 3}, 0.5f), fill(first, {-1, 0, 0}, 0.25f);
  fill(second, {-1, 0, 0}, 0.25f), fill(second, {1, 2, 3}, 0.5f);
  second.store.find_or_create({40, 40, 40});
  fill(third, {-1, 0, 0}, 0.25f), fill(third, {1, 2, 3}, 0.50001f);
  CHECK(map_hash(first) == map_hash(second));
  CHECK(map_hash(first) != map_hash(third));
}

TEST_CASE("the map hash changes with one value of any plane, with one bit of a region and with how a touch is read") {
  const auto make = [] {
    Map map = test::random_map({.seed = 3, .blocks = 12, .classes = 3, .shared_evidence = true, .instances = true});
    Property friction;
    friction.name = "friction";
    map.properties = PropertyTable({friction});
    const test::VoxelAt voxel = test::voxel_with_everything(map);
    Touch touch;
    touch.request.property = "friction";
    touch.request.value = 0.3;
    BlockMask mask;
    mask.set(voxel.offset);
    touch.region.append(voxel.block.coord, mask);
    insert(map.touches, touch);
    rebuild_touch_planes(map);
    return map;
  };
  struct Case {
    const char* what;
    std::function<void(Map&, Block&, int)> change;
  };
  const auto touch_of = [](Map& map) -> Touch& { return map.touches.touches[0]; };
  const Case cases[] = {
      {"nothing", [](Map&, Block&, int) {}},
      {"voxel size", [](Map& m, Block&, int) { m.voxel_size_m = 0.021; }},
      {"truncation", [](Map& m, Block&, int) { m.truncation_m = 0.09; }},
      {"coordinate", [](Map&, Block& b, int) { b.coord.z += 100; }},
      {"tsdf", [](Map&, Block& b, int i) { b.geometry->tsdf[i] = 0.0123f; }},
      {"weight", [](Map&, Block& b, int i) { b.geometry->weight[i] += 1; }},
      {"red", [](Map&, Block& b, int i) { b.color->r[i] ^= 1; }},
      {"green", [](Map&, Block& b, int i) { b.color->g[i] ^= 1; }},
      {"blue", [](Map&, Block& b, int i) { b.color->b[i] ^= 1; }},
      {"count of colour", [](Map&, Block& b, int i) { b.color->count[i] ^= 1; }},
      {"class", [](Map&, Block& b, int) { b.evidence.back().slot = 7; }},
      {"evidence", [](Map&, Block& b, int i) { b.evidence[0].counts->value[i] += 1; }},
      {"even evidence", [](Map&, Block& b, int i) { b.even_evidence->value[i] += 1; }},
      {"instance", [](Map&, Block& b, int i) { b.instance->id[i] ^= 1; }},
      {"votes", [](Map&, Block& b, int i) { b.instance->votes[i] ^= 1; }},
      {"property", [](Map&, Block& b, int) { b.touch[0].property = 1; }},
      {"n", [](Map&, Block& b, int i) { b.touch[0].n->value[i] = 2; }},
      {"mean", [](Map&, Block& b, int i) { b.touch[0].mean->value[i] = 0.4f; }},
      {"m2", [](Map&, Block& b, int i) { b.touch[0].m2->value[i] = 0.1f; }},
      {"region", [&](Map& m, Block&, int i) { touch_of(m).region.mask[0].set((i + 1) % kBlockVoxels); }},
      {"reading", [&](Map& m, Block&, int) { touch_of(m).request.value = 0.31; }},
      {"sigma", [&](Map& m, Block&, int) { touch_of(m).request.sigma = 0.01; }},
      {"rho", [&](Map& m, Block&, int) { touch_of(m).request.rho = 0.2; }},
      {"model", [&](Map& m, Block&, int) { touch_of(m).request.model = TouchModel::mixture; }},
      {"projection", [&](Map& m, Block&, int) { touch_of(m).request.projection = Projection::published; }},
      {"undone", [&](Map& m, Block&, int) { touch_of(m).undone = true; }},
  };
  std::set<std::string> hashes;
  for (const Case& c : cases) {
    Map map = make();
    const test::VoxelAt voxel = test::voxel_with_everything(map);
    c.change(map, voxel.block, voxel.offset);
    INFO(c.what);
    CHECK(hashes.insert(map_hash(map)).second);
  }
  CHECK(hashes.contains(map_hash(make())));
}

TEST_CASE("the geometry of a large map takes at most 9 bytes a voxel") {
  for (const int blocks : {1025, 3000, 5000}) {
    BlockStore store(0.08f);
    for (int i = 0; i < blocks; ++i) store.find_or_create({i % 20, i / 20 % 20, i / 400});
    INFO(blocks << " blocks");
    const size_t voxels = size_t(blocks) * kBlockVoxels;
    CHECK(store.geometry_bytes() >= 8 * voxels);
    CHECK(store.geometry_bytes() <= 9 * voxels);
    CHECK(store.color_bytes() + store.instance_bytes() + store.plane_bytes() == 0);
  }
}

TEST_CASE("the stock grids hold the map's values at the voxel's index") {
  Map map(0.02, 0.08);
  Block& b = map.store[map.store.find_or_create({-1, 0, 2})];
  b.geometry->tsdf[voxel_offset(7, 3, 1)] = -0.03f;
  b.geometry->weight[voxel_offset(7, 3, 1)] = 4;
  const BlockLists lists = block_lists(map);
  const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(stock_grid(tsdf_grid(map, lists.observed)));
  const auto weight = openvdb::gridPtrCast<openvdb::FloatGrid>(stock_grid(weight_grid(map, lists.observed)));
  CHECK(tsdf->tree().getValue({-1, 3, 17}) == -0.03f);
  CHECK(tsdf->tree().isValueOn({-1, 3, 17}));
  CHECK(tsdf->activeVoxelCount() == 1);
  CHECK(tsdf->background() == 0.08f);
  CHECK(weight->tree().getValue({-1, 3, 17}) == 4);
  CHECK(tsdf->getGridClass() == openvdb::GRID_LEVEL_SET);
  CHECK(tsdf->indexToWorld(openvdb::Coord(-1, 3, 17)).x() == Approx(-0.02));
}

TEST_CASE("the nearest voxel of a point is that of the next centre, and far points have none") {
  const Map map(0.02, 0.08);
  const auto nearest = [&](double x, double y, double z) { return nearest_voxel(map, {x, y, z}); };
  CHECK(nearest(0, 0.009, -0.009) == Index3{0, 0, 0});
  CHECK(nearest(0.011, -0.011, -0.05) == Index3{1, -1, -3});  // halves away from zero
  CHECK(nearest(2e7, 0, 0) == Index3{1000000000, 0, 0});
  CHECK(nearest(0, -2.1e7, 0) == std::nullopt);
  CHECK(nearest(0, 0, std::numeric_limits<double>::infinity()) == std::nullopt);
  CHECK(nearest(std::numeric_limits<double>::quiet_NaN(), 0, 0) == std::nullopt);
}
