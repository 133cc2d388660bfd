#include "io/map_file/vdb_writer.h"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <fstream>
#include <random>

#include "io/files/text_input.h"
#include "io/map_file/map_grids.h"
#include "tests/support/data.h"
#include "tests/support/random_map.h"

using namespace felt;
namespace fs = std::filesystem;

namespace {

/// Blocks in all octants, in several nodes of every level.
LeafCoords scattered_coords(int count, std::mt19937_64& engine) {
  std::vector<BlockCoord> coords;
  for (const int reach : {3, 40, 1200})
    for (int i = 0; i < count; ++i) {
      const auto next = [&] { return int(engine() % uint64_t(2 * reach + 1)) - reach; };
      const BlockCoord c{next(), next(), next()};
      if (std::find(coords.begin(), coords.end(), c) == coords.end()) coords.push_back(c);
    }
  return std::make_shared<const std::vector<BlockCoord>>(std::move(coords));
}

float number(std::mt19937_64& engine) { return float(int(engine() % 2000) - 1000) / 64; }

template <typename Value>
Value random_value(std::mt19937_64& engine) {
  if constexpr (std::is_same_v<Value, openvdb::Vec3s>)
    return {number(engine), number(engine), number(engine)};
  else
    return Value(number(engine));
}

/// Leaves that are full, empty, in_16_bits full, and such with other values than the background where they are
/// inactive.
template <typename Value>
LeafGrid random_grid(const std::string& name, Value background, bool keeps_empty) {
  std::mt19937_64 engine(name.size());
  Leaves<Value> leaves;
  leaves.background = background;
  leaves.coords = scattered_coords(20, engine);
  leaves.keeps_empty = keeps_empty;
  leaves.fill = [background](size_t i, Value* values) {
    std::mt19937_64 own(i);
    BlockMask active;
    for (int v = 0; v < kBlockVoxels; ++v) {
      values[v] = random_value<Value>(own);
      if (i % 4 == 0 || (i % 4 > 1 && own() % 3 == 0))
        active.set(v);
      else if (i % 4 != 3)
        values[v] = background;
    }
    return active;
  };
  return {.name = name, .voxel_size_m = 0.02, .leaves = leaves};
}

LeafGrid random_region(const std::string& name) {
  std::mt19937_64 engine(7);
  std::vector<BlockCoord> coords = *scattered_coords(20, engine);
  std::sort(coords.begin(), coords.end());
  Region region;
  for (const BlockCoord& c : coords) {
    BlockMask mask;
    for (int v = 0; v < 100; ++v) mask.set(int(engine() % kBlockVoxels));
    region.append(c, mask);
  }
  return {.name = name, .voxel_size_m = 0.02, .leaves = region};
}

std::vector<LeafGrid> random_grids() {
  std::vector<LeafGrid> grids = {random_grid<float>("distances", 0.08f, true), random_grid<float>("view", 0.0f, false),
                                 random_grid<int32_t>("labels", -1, true),
                                 random_grid<openvdb::Vec3s>("colours", openvdb::Vec3s(0.0f), true),
                                 random_region("region")};
  grids[0].grid_class = openvdb::GRID_LEVEL_SET;
  return grids;
}

void write(const fs::path& path, const std::vector<LeafGrid>& grids, VdbCodec codec, bool in_16_bits = false) {
  VdbWriter writer(path);
  openvdb::MetaMap metadata;
  metadata.insertMeta("creator", openvdb::StringMetadata("test"));
  writer.begin(metadata, grids.size(), "seed");
  for (const LeafGrid& grid : grids) writer.write(grid, codec, in_16_bits);
  writer.commit();
}

template <typename Grid>
void require_same_leaves(const Grid& found, const Grid& expected, bool in_16_bits) {
  const auto background = expected.background();
  REQUIRE(found.background() == (in_16_bits ? openvdb::io::truncateRealToHalf(background) : background));
  REQUIRE(found.tree().leafCount() == expected.tree().leafCount());
  REQUIRE(found.tree().hasSameTopology(expected.tree()));
  for (auto leaf = expected.tree().cbeginLeaf(); leaf; ++leaf) {
    const auto* other = found.tree().probeConstLeaf(leaf->origin());
    REQUIRE(other != nullptr);
    REQUIRE(other->getValueMask() == leaf->getValueMask());
    for (openvdb::Index i = 0; i < 512; ++i) {
      auto value = leaf->getValue(i);
      if (in_16_bits) value = openvdb::io::truncateRealToHalf(value);
      REQUIRE(other->getValue(i) == value);
    }
  }
}

void require_same(const openvdb::GridBase::Ptr& found, const openvdb::GridBase::Ptr& expected, bool in_16_bits) {
  INFO(expected->getName());
  REQUIRE(found);
  REQUIRE(found->type() == expected->type());
  CHECK(found->transform() == expected->transform());
  CHECK(found->getGridClass() == expected->getGridClass());
  CHECK(found->getVectorType() == expected->getVectorType());
  CHECK(found->saveFloatAsHalf() == in_16_bits);
  CHECK(found->metaValue<int64_t>("file_voxel_count") == int64_t(expected->activeVoxelCount()));
  const openvdb::CoordBBox bounds = expected->evalActiveVoxelBoundingBox();
  CHECK(found->metaValue<openvdb::Vec3i>("file_bbox_min") == bounds.min().asVec3i());
  CHECK(found->metaValue<openvdb::Vec3i>("file_bbox_max") == bounds.max().asVec3i());
  const auto compare = [&]<typename Grid>(const Grid*) {
    const auto a = openvdb::gridPtrCast<Grid>(found), b = openvdb::gridPtrCast<Grid>(expected);
    if (b) require_same_leaves(*a, *b, in_16_bits);
  };
  compare(static_cast<const openvdb::FloatGrid*>(nullptr));
  compare(static_cast<const openvdb::Int32Grid*>(nullptr));
  compare(static_cast<const openvdb::Vec3SGrid*>(nullptr));
  compare(static_cast<const openvdb::MaskGrid*>(nullptr));
}

}  // namespace

TEST_CASE("OpenVDB's own readers find every leaf, mask and value of what was written without a tree") {
  openvdb::initialize();
  const test::TemporaryDirectory directory;
  const fs::path path = directory.path() / "grids.vdb";
  const std::vector<LeafGrid> grids = random_grids();
  for (const bool in_16_bits : {false, true})
    for (const VdbCodec codec : {VdbCodec::none, VdbCodec::blosc, VdbCodec::zip}) {
      INFO("codec " << int(codec) << ", in_16_bits " << in_16_bits);
      write(path, grids, codec, in_16_bits);
      // By the places that stand in the file ...
      openvdb::io::File file(path.string());
      file.open(/*delayLoad=*/false);
      REQUIRE(file.getMetadata()->metaValue<std::string>("creator") == "test");
      for (const LeafGrid& grid : grids) require_same(file.readGrid(grid.name), stock_grid(grid), in_16_bits);
      // ... and one after the other.
      std::ifstream stream(path, std::ios::binary);
      const auto read = openvdb::io::Stream(stream, /*delayLoad=*/false).getGrids();
      REQUIRE(read->size() == grids.size());
      for (size_t g = 0; g < grids.size(); ++g) require_same((*read)[g], stock_grid(grids[g]), in_16_bits);
    }
}

TEST_CASE("a part of a grid has the values inside and the background outside, and no leaf of nothing") {
  openvdb::initialize();
  const test::TemporaryDirectory directory;
  const Region region = std::get<Region>(random_region("region").leaves);
  for (const LeafGrid& grid : random_grids()) {
    const openvdb::GridBase::Ptr whole = stock_grid(grid), part = stock_grid(clipped(grid, region));
    if (const auto values = openvdb::gridPtrCast<openvdb::FloatGrid>(part)) {
      const auto all = openvdb::gridPtrCast<openvdb::FloatGrid>(whole);
      openvdb::Index64 active = 0;
      for (auto value = all->cbeginValueOn(); value; ++value) {
        const openvdb::Coord c = value.getCoord();
        const bool inside = region.contains({c.x(), c.y(), c.z()});
        active += inside;
        REQUIRE(values->tree().isValueOn(c) == inside);
        REQUIRE(values->tree().getValue(c) == (inside ? *value : all->background()));
      }
      CHECK(values->activeVoxelCount() == active);
      for (auto leaf = values->tree().cbeginLeaf(); leaf; ++leaf) CHECK_FALSE(leaf->isEmpty());
    }
    if (grid.name == "region") CHECK(part->activeVoxelCount() == region.voxels());
  }
}

TEST_CASE("the bytes of a file do not depend on the number of threads") {
  const test::TemporaryDirectory directory;
  const Map map = test::random_map({.seed = 8, .blocks = 60, .classes = 3});
  for (const VdbCodec codec : {VdbCodec::none, VdbCodec::blosc, VdbCodec::zip}) {
    write(directory.path() / "many.vdb", map_grids(map), codec);
    {
      const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
      write(directory.path() / "one.vdb", map_grids(map), codec);
    }
    CHECK(read_whole_file(directory.path() / "one.vdb") == read_whole_file(directory.path() / "many.vdb"));
  }
}

TEST_CASE("a grid larger than what is kept in memory while its size is found is written all the same") {
  openvdb::initialize();
  const test::TemporaryDirectory directory;
  std::vector<BlockCoord> coords;
  for (int x = 0; x < 33; ++x)
    for (int y = 0; y < 32; ++y)
      for (int z = 0; z < 32; ++z) coords.push_back({x, y - 16, z});
  Leaves<float> leaves;
  leaves.coords = std::make_shared<const std::vector<BlockCoord>>(coords);
  leaves.fill = [](size_t i, float* values) {
    std::fill_n(values, kBlockVoxels, 0.0f);
    BlockMask active;
    for (int v = 0; v < 40 && i % 5 != 0; ++v) values[v] = float(i), active.set(v);
    return active;
  };
  const LeafGrid grid{.name = "large", .voxel_size_m = 0.02, .leaves = leaves};
  write(directory.path() / "large.vdb", {grid}, VdbCodec::blosc);
  openvdb::io::File file((directory.path() / "large.vdb").string());
  file.open(/*delayLoad=*/false);
  const auto read = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("large"));
  REQUIRE(read->tree().leafCount() == coords.size() - (coords.size() + 4) / 5);
  for (size_t i = 0; i < coords.size(); ++i) {
    const Index3 first = first_voxel(coords[i]);
    REQUIRE(read->tree().getValue({first.x, first.y + 4, first.z + 7}) == (i % 5 == 0 ? 0.0f : float(i)));
  }
}
