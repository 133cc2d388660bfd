#include "mapping/store/block_store.h"

#include <catch2/catch.hpp>

#include "mapping/grids/vdb_state.h"
#include "mapping/map.h"

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
