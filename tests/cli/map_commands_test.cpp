#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "io/map_file/map_file.h"
#include "tests/cli/command.h"
#include "tests/support/data.h"
#include "tests/support/random_map.h"

namespace felt::test {
namespace {

using Catch::Matchers::Contains;
namespace fs = std::filesystem;

struct Maps {
  TemporaryDirectory directory;
  std::string a = (directory.path() / "a.vdb").string(), b = (directory.path() / "b.vdb").string(),
              out = (directory.path() / "out.vdb").string();
  Maps() {
    Map map = random_map({.seed = 1, .blocks = 4, .classes = 2});
    save_map(map, a);
    map.frames = {};
    record_frame(map.frames, "second recording", "", 0);
    map.store[0].geometry->tsdf[100] = 0;
    save_map(map, b);
  }
};

}  // namespace

TEST_CASE("verify says that a saved map is sound and that a damaged one is not") {
  const Maps maps;
  CHECK(run_feltmap("verify " + maps.a).exit_code == 0);
  const auto sound = nlohmann::json::parse(run_feltmap("verify --json " + maps.a).out);
  CHECK(sound.at("sound") == true);
  CHECK(sound.at("map_hash") == map_hash(load_map(maps.a)));
  std::fstream(maps.a, std::ios::in | std::ios::out).seekp(2000).put('!');
  const CommandResult damaged = run_feltmap("verify " + maps.a);
  CHECK(damaged.exit_code == 1);
  CHECK_THAT(damaged.out, Contains("checksum"));
  CHECK(run_feltmap("verify " + maps.out).exit_code == 4);
}

TEST_CASE("verify names a broken invariant and the voxel") {
  const Maps maps;
  Map map = random_map({.seed = 1, .blocks = 4});
  map.store[0].geometry->weight[100] = -3;
  save_map(map, maps.a);
  const CommandResult result = run_feltmap("verify --json " + maps.a);
  CHECK(result.exit_code == 1);
  const auto report = nlohmann::json::parse(result.out);
  CHECK(report.at("faults").at(0).at("grid") == "weight");
}

TEST_CASE("diff exits with 0 for equal maps and with 1 beyond the tolerance, and says where") {
  const Maps maps;
  CHECK(run_feltmap("diff " + maps.a + " " + maps.a).exit_code == 0);
  const CommandResult different = run_feltmap("diff --json " + maps.a + " " + maps.b);
  CHECK(different.exit_code == 1);
  const auto report = nlohmann::json::parse(different.out);
  CHECK(report.at("channels").at("tsdf").at("voxels_changed") == 1);
  CHECK(report.at("channels").at("weight").at("voxels_changed") == 0);
  CHECK(run_feltmap("diff --tol 0.08 " + maps.a + " " + maps.b).exit_code == 0);
  CHECK_THAT(run_feltmap("diff " + maps.a + " " + maps.b).out, Contains("tsdf") && Contains("class flips: 0"));
  CHECK(run_feltmap("diff " + maps.a).exit_code == 2);
}

TEST_CASE("merge writes one map, whatever the order of its arguments, and refuses shared frames") {
  const Maps maps;
  REQUIRE(run_feltmap("merge " + maps.a + " " + maps.b + " --out " + maps.out).exit_code == 0);
  const std::string hash = map_hash(load_map(maps.out));
  CHECK(frame_count(load_map(maps.out).frames) == frame_count(load_map(maps.a).frames) + 1);
  REQUIRE(run_feltmap("merge " + maps.b + " " + maps.a + " --out " + maps.out).exit_code == 0);
  CHECK(map_hash(load_map(maps.out)) == hash);
  const CommandResult twice = run_feltmap("merge " + maps.a + " " + maps.a + " --out " + maps.out);
  CHECK(twice.exit_code == 3);
  CHECK_THAT(twice.err, Contains("shared"));
  CHECK(map_hash(load_map(maps.out)) == hash);
  CHECK(run_feltmap("merge --allow-shared-frames " + maps.a + " " + maps.a + " --out " + maps.out + "2").exit_code ==
        0);
}

TEST_CASE("a map is replaced only by one that holds all that it holds, or with --force") {
  const Maps maps;
  const auto hash_of = [](const std::string& file) { return map_hash(load_map(file)); };
  const std::string merge = "merge " + maps.a + " " + maps.b + " --out " + maps.out;
  REQUIRE(run_feltmap(merge).exit_code == 0);
  const std::string merged = hash_of(maps.out);
  CHECK(run_feltmap(merge).exit_code == 0);  // again

  const CommandResult lost = run_feltmap("merge " + maps.b + " --out " + maps.out);
  CHECK(lost.exit_code == 4);
  CHECK_THAT(lost.err, Contains("out.vdb") && Contains("frames") && Contains("--force"));
  CHECK(hash_of(maps.out) == merged);
  CHECK(run_feltmap("merge " + maps.b + " --out " + maps.out + " --force").exit_code == 0);
  CHECK(hash_of(maps.out) != merged);

  std::ofstream(maps.out) << "notes";
  const CommandResult notes = run_feltmap("merge " + maps.a + " --out " + maps.out);
  CHECK(notes.exit_code == 4);
  CHECK_THAT(notes.err, Contains("no map"));
  CHECK(std::filesystem::file_size(maps.out) == 5);
  CHECK(run_feltmap("merge " + maps.a + " --out " + maps.a).exit_code == 0);  // grows in place
}

}  // namespace felt::test
