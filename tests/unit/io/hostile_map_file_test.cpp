#include <openvdb/openvdb.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <random>

#include "core/error.h"
#include "io/map_file/map_file.h"
#include "io/map_file/map_grids.h"
#include "io/map_file/map_metadata.h"
#include "io/map_file/map_trailer.h"
#include "io/map_file/vdb_writer.h"
#include "mapping/touch/touch_update.h"
#include "tests/support/data.h"
#include "tests/support/labelled_map.h"
#include "tests/support/random_map.h"

using namespace felt;
using Catch::Matchers::Contains;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

/// Writes a map file as `save_map` does, but for what `alter` does to the grid of that name: checksum and hash are
/// right.
void save_altered(const Map& map, const std::filesystem::path& path, const std::string& name,
                  const std::function<void(LeafGrid&)>& alter) {
  MapTrailer trailer;
  VdbWriter file(path, &trailer);
  std::vector<LeafGrid> grids = map_grids(map);
  bool found = false;
  for (LeafGrid& grid : grids)
    if (grid.name == name) found = true, alter(grid);
  REQUIRE(found);
  const std::string hash = map_hash(map);
  file.begin(to_metadata(map, hash), grids.size(), hash);
  for (const LeafGrid& grid : grids) file.write(grid, VdbCodec::none);
  file.commit(trailer.finish(kMapFileVersion));
}

/// Changes the first leaf of a grid that has an active voxel: `change(values, active, first active voxel)`.
template <typename Value>
std::function<void(LeafGrid&)> first_leaf(std::function<void(Value*, BlockMask&, int)> change) {
  return [change](LeafGrid& grid) {
    auto& leaves = std::get<Leaves<Value>>(grid.leaves);
    std::vector<Value> values(kBlockVoxels);
    size_t first = 0;
    while (!leaves.fill(first, values.data()).any()) ++first;
    leaves.fill = [fill = leaves.fill, change, first](size_t i, Value* to) {
      BlockMask active = fill(i, to);
      if (i != first) return active;
      int voxel = 0;
      while (!active.test(voxel)) ++voxel;
      change(to, active, voxel);
      return active;
    };
  };
}

/// Another value in an active voxel.
template <typename Value>
std::function<void(LeafGrid&)> value_of_voxel(Value value) {
  return first_leaf<Value>([value](Value* values, BlockMask&, int voxel) { values[voxel] = value; });
}

/// An active voxel that is not so in the file.
template <typename Value>
std::function<void(LeafGrid&)> voxel_off() {
  return first_leaf<Value>([](Value*, BlockMask& active, int voxel) {
    BlockMask one;
    one.set(voxel);
    active -= one;
  });
}

}  // namespace

TEST_CASE(
    "a map file of which other programs would see another map is refused, though its checksum and hash are right") {
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "map.vdb";
  const Map map = test::random_map({.seed = 12, .blocks = 6, .classes = 2, .shared_evidence = true, .instances = true});
  const auto refused = [&](const std::string& grid, const std::function<void(LeafGrid&)>& alter) -> std::string {
    save_altered(map, path, grid, alter);
    try {
      load_map(path);
    } catch (const FormatError& error) {
      return error.what();
    }
    return "loaded";
  };
  CHECK(refused("tsdf", [](LeafGrid&) {}) == "loaded");
  for (const LeafGrid& grid : map_grids(map)) {
    INFO(grid.name);
    CHECK_THAT(refused(grid.name, [](LeafGrid& g) { g.voxel_size_m *= 2; }),
               Contains("'" + grid.name + "'") && Contains("transform"));
  }
  for (const char* grid : {"tsdf", "weight", "evidence/class 0", "evidence_even"})
    CHECK_THAT(refused(grid, voxel_off<float>()),
               Contains(grid) && Contains("active") && Contains("1 that are not so"));
  for (const char* grid : {"color_count", "instance", "instance_votes"})
    CHECK_THAT(refused(grid, voxel_off<int32_t>()), Contains(grid) && Contains("active"));
  CHECK_THAT(refused("color", voxel_off<openvdb::Vec3s>()), Contains("color") && Contains("active"));
  for (const float number : {-1.0f, 1.1f, kNan, std::numeric_limits<float>::infinity()})
    CHECK_THAT(refused("color",
                       [number](LeafGrid& grid) {
                         auto& leaves = std::get<Leaves<openvdb::Vec3s>>(grid.leaves);
                         leaves.fill = [fill = leaves.fill, number](size_t i, openvdb::Vec3s* to) {
                           const BlockMask active = fill(i, to);
                           for (int v = 0; v < kBlockVoxels; ++v)
                             if (to[v].y() > 0) to[v].y() = number;
                           return active;
                         };
                       }),
               Contains("color") && Contains("0 to 1"));
  CHECK_THAT(refused("color", value_of_voxel(openvdb::Vec3s(0.5f))), Contains("'color_count' has no leaf"));
  for (const char* grid : {"tsdf", "weight", "evidence_even"})
    CHECK_THAT(refused(grid, [](LeafGrid& g) { std::get<Leaves<float>>(g.leaves).background = 0.5f; }),
               Contains(grid) && Contains("background"));
}

TEST_CASE("what a file's views say must follow from its map") {
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "map.vdb";
  const Map map = test::touched_floor(test::wood_then_ice);
  const auto faulty = [&](const std::string& grid, const std::function<void(LeafGrid&)>& alter) {
    save_altered(map, path, grid, alter);
    std::vector<std::string> grids;
    for (const MapFault& fault : examine_map(path).faults) {
      grids.push_back(fault.grid);
      CHECK(fault.voxels == 1);
      CHECK(map.store.get(block_of_voxel(fault.first)) != nullptr);
    }
    return grids;
  };
  const auto only = [](const std::string& grid) { return std::vector<std::string>{grid}; };
  CHECK(faulty("label", value_of_voxel<int32_t>(7777)) == only("label"));
  CHECK(faulty("label", voxel_off<int32_t>()) == only("label"));
  for (const char* grid : {"entropy", "label_prob", "evidence_total", "friction_mean", "friction_sd",
                           "property/friction/ice/kappa", "touch/friction/n"}) {
    INFO(grid);
    CHECK(faulty(grid, value_of_voxel(kNan)) == only(grid));
    CHECK(faulty(grid, value_of_voxel(1e9f)) == only(grid));
    CHECK(faulty(grid, voxel_off<float>()) == only(grid));
    // Another processor rounds otherwise.
    CHECK(faulty(grid, first_leaf<float>([](float* values, BlockMask&, int voxel) {
                   values[voxel] = std::nextafter(values[voxel], 1e9f);
                 })) == std::vector<std::string>());
  }
  CHECK(faulty("touched", [](LeafGrid& grid) {
          Region& region = std::get<Region>(grid.leaves);
          int voxel = 0;
          while (!region.mask[0].test(voxel)) ++voxel;
          BlockMask one;
          one.set(voxel);
          region.mask[0] -= one;
        }) == only("touched"));
  save_altered(map, path, "label", [](LeafGrid& grid) { std::get<Leaves<int32_t>>(grid.leaves).background = 0; });
  CHECK_FALSE(examine_map(path).faults.empty());
  save_altered(map, path, "property/friction/ice/kappa",
               [](LeafGrid& grid) { grid.name = "property/warmth/ice/kappa"; });
  REQUIRE(examine_map(path).faults.size() == 1);
  CHECK(examine_map(path).faults[0].grid == "property/warmth/ice/kappa");
}

TEST_CASE("a map file is sound as it was saved, with its views or without") {
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "map.vdb";
  const auto require_sound = [&](const Map& map) {
    save_map(map, path);
    const ExaminedMap whole = examine_map(path);
    CHECK(whole.faults.empty());
    CHECK(whole.views == view_grids(map).size());
    CHECK(map_hash(whole.map) == map_hash(map));
    save_map(map, path, {.compression = MapCompression::zip, .views = false});
    const ExaminedMap compact = examine_map(path);
    CHECK(compact.faults.empty());
    CHECK(compact.views == 0);
  };
  require_sound(Map(0.03, 0.12));
  require_sound(test::touched_floor(test::wood_then_ice));
  require_sound(test::random_map({.seed = 2, .blocks = 30, .classes = 4, .shared_evidence = true, .instances = true}));
}

TEST_CASE("a map file with any byte changed or any part cut off is refused or loads unchanged") {
  // FELTMAP_CORRUPTIONS=10000 for the long run.
  const char* asked = std::getenv("FELTMAP_CORRUPTIONS");
  const int trials = asked != nullptr ? std::atoi(asked) : 400;
  REQUIRE(trials > 0);
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "map.vdb";
  const Map map = test::random_map({.seed = 12, .blocks = 2, .classes = 2});
  const std::string hash = map_hash(map);
  save_map(map, path);
  std::ifstream file(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(file), {}};
  std::mt19937_64 engine(1);
  int refused = 0, unchanged = 0;
  for (int trial = 0; trial < trials; ++trial) {
    std::string bytes = whole;
    if (trial % 4 == 3)
      bytes.resize(engine() % whole.size());
    else
      bytes[engine() % whole.size()] ^= char(1 + engine() % 255);
    std::ofstream(path, std::ios::binary) << bytes;
    try {
      unchanged += map_hash(load_map(path)) == hash;
    } catch (const FormatError&) {
      ++refused;
    }
  }
  CHECK(refused + unchanged == trials);
  CHECK(refused > trials * 9 / 10);
}
