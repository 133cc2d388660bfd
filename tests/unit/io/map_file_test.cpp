#include "io/map_file/map_file.h"

#include <openvdb/openvdb.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <random>

#include "core/error.h"
#include "io/files/text_input.h"
#include "mapping/maps/map_diff.h"
#include "tests/support/data.h"
#include "tests/support/random_map.h"

using namespace felt;
using Catch::Matchers::Contains;
namespace fs = std::filesystem;

namespace {

void write_bytes(const fs::path& path, const std::string& bytes) { std::ofstream(path, std::ios::binary) << bytes; }

}  // namespace

TEST_CASE("a loaded map has the hash, the tables and the journals of the saved one") {
  const test::TemporaryDirectory directory;
  const Map map = test::random_map({.seed = 3, .blocks = 40, .classes = 5, .shared_evidence = true, .instances = true});
  for (const MapCompression compression :
       {MapCompression::fast, MapCompression::none, MapCompression::blosc, MapCompression::zip}) {
    save_map(map, directory.path() / "map.vdb", {.compression = compression});
    const Map loaded = load_map(directory.path() / "map.vdb");
    CHECK(map_hash(loaded) == map_hash(map));
    CHECK_FALSE(beyond(difference(map, loaded), 0));
    CHECK(loaded.voxel_size_m == map.voxel_size_m);
    CHECK(loaded.truncation_m == map.truncation_m);
    CHECK(loaded.classes == map.classes);
    CHECK(loaded.frames == map.frames);
    CHECK(loaded.metadata == map.metadata);
  }
}

TEST_CASE("a loaded map keeps the priors that its classes had by default") {
  const test::TemporaryDirectory directory;
  const Map map = test::random_map({.seed = 5, .blocks = 4, .classes = 20});
  REQUIRE(map.classes.prior(0) == 0.4);
  save_map(map, directory.path() / "map.vdb");
  const Map loaded = load_map(directory.path() / "map.vdb");
  CHECK(loaded.classes.at_slot(0).prior == 0.4);
  CHECK(loaded.classes == map.classes);
  CHECK(map_hash(loaded) == map_hash(map));
}

TEST_CASE("a loaded map has no plane that the saved one had not, and the other way round") {
  const test::TemporaryDirectory directory;
  Map map(0.02, 0.08);
  map.classes = ClassTable({{1, "wood", {}, false}, {2, "grass", {}, false}});
  for (int i = 0; i < 4; ++i) {
    Block& block = map.store[map.store.find_or_create({i - 2, 5, -7})];
    block.geometry->weight[17] = 1;
    if (i == 1) map.store.add_color(block);                            // planes of zeros are planes
    if (i == 2) block.evidence.push_back({1, map.store.new_plane()});  // and so here
  }
  save_map(map, directory.path() / "map.vdb");
  const Map loaded = load_map(directory.path() / "map.vdb");
  REQUIRE(loaded.store.size() == 4);
  CHECK(loaded.store.get({-2, 5, -7})->color == nullptr);
  CHECK(loaded.store.get({-1, 5, -7})->color != nullptr);
  CHECK(loaded.store.get({0, 5, -7})->evidence.size() == 1);
  CHECK(loaded.store.get({1, 5, -7})->evidence.empty());
  CHECK(map_hash(loaded) == map_hash(map));
}

TEST_CASE("frames may be numbered by nanoseconds") {
  const test::TemporaryDirectory directory;
  Map map(0.05, 0.2);
  for (const int64_t stamp : {1520531829251142058, 1520531829284475391, 1520531829317808724, 1520531830000000001})
    record_frame(map.frames, "recording", "settings", stamp);
  save_map(map, directory.path() / "map.vdb");
  CHECK(load_map(directory.path() / "map.vdb").frames == map.frames);
}

TEST_CASE("an empty map can be saved and loaded") {
  const test::TemporaryDirectory directory;
  const Map map(0.05, 0.2);
  save_map(map, directory.path() / "map.vdb");
  const Map loaded = load_map(directory.path() / "map.vdb");
  CHECK(loaded.store.empty());
  CHECK(map_hash(loaded) == map_hash(map));
}

TEST_CASE("equal maps give equal files, whatever the order in which their blocks came") {
  const test::TemporaryDirectory directory;
  const Map map = test::random_map({.seed = 9, .blocks = 30, .classes = 3});
  save_map(map, directory.path() / "a.vdb");
  save_map(load_map(directory.path() / "a.vdb"), directory.path() / "b.vdb");
  CHECK(read_whole_file(directory.path() / "a.vdb") == read_whole_file(directory.path() / "b.vdb"));
}

TEST_CASE("a stock reader sees the grids of a map file, with their metadata and grid offsets") {
  const test::TemporaryDirectory directory;
  const Map map = test::random_map({.seed = 4, .blocks = 20, .classes = 2});
  save_map(map, directory.path() / "map.vdb");
  openvdb::io::File file((directory.path() / "map.vdb").string());
  file.open();
  const auto tsdf = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("tsdf"));
  REQUIRE(tsdf);
  CHECK(tsdf->getGridClass() == openvdb::GRID_LEVEL_SET);
  CHECK(tsdf->activeVoxelCount() == active_voxel_count(map));
  CHECK(tsdf->background() == float(map.truncation_m));
  // Index coordinates are voxel centres.
  CHECK(tsdf->indexToWorld(openvdb::Coord(1, 0, 0)).x() == Approx(map.voxel_size_m));
  CHECK(tsdf->metaValue<int64_t>("file_voxel_count") == int64_t(active_voxel_count(map)));
  const auto weight = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("weight"));
  CHECK(weight->tree().hasSameTopology(tsdf->tree()));
  CHECK(file.hasGrid("color"));
  CHECK(file.hasGrid("evidence/class 1"));
  CHECK(file.getMetadata()->metaValue<std::string>("map_hash") == map_hash(map));
}

TEST_CASE("a map file that lacks its trailer, has another version or was changed is refused with the reason") {
  const test::TemporaryDirectory directory;
  const fs::path path = directory.path() / "map.vdb";
  save_map(test::random_map({.seed = 5, .blocks = 3, .classes = 1}), path);
  const std::string whole = read_whole_file(path);
  const auto refused = [&](std::string bytes) -> std::string {
    write_bytes(path, bytes);
    try {
      load_map(path);
    } catch (const FormatError& error) {
      return error.what();
    }
    return "loaded";
  };
  CHECK_THAT(refused(whole.substr(0, whole.size() - 1)), Contains("trailer") && Contains("cut short"));
  CHECK_THAT(refused(whole.substr(0, 10)), Contains("10 bytes"));
  CHECK_THAT(refused(""), Contains("0 bytes"));
  std::string changed = whole;
  changed[changed.size() / 2] ^= 1;
  CHECK_THAT(refused(changed), Contains("checksum"));
  changed = whole;
  changed[whole.size() - 32] = 9;
  CHECK_THAT(refused(changed), Contains("format version: expected 1, found 9"));
  changed = whole;
  changed.insert(100, "x");
  CHECK_THAT(refused(changed), Contains("size"));
  CHECK_THROWS_WITH(load_map(directory.path() / "absent.vdb"), Contains("absent.vdb: cannot open"));
  CHECK_THROWS_WITH(load_map(directory.path()), Contains("a regular file") && Contains("a folder"));
}

TEST_CASE("a failed save leaves the map that was there") {
  const test::TemporaryDirectory directory;
  const fs::path path = directory.path() / "map.vdb";
  Map map = test::random_map({.seed = 6, .blocks = 3, .classes = 1});
  save_map(map, path);
  const std::string before = read_whole_file(path);
  map.frames.runs.push_back({"not \xff UTF-8", "", {0}});
  CHECK_THROWS_AS(save_map(map, path), Error);
  CHECK(read_whole_file(path) == before);
  CHECK(std::distance(fs::directory_iterator(directory.path()), {}) == 1);
  CHECK_THROWS_AS(save_map(map, directory.path() / "no such folder" / "map.vdb"), IoError);
}
