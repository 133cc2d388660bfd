#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "io/map_file/map_file.h"
#include "tests/cli/command.h"
#include "tests/support/data.h"
#include "tests/support/labelled_map.h"
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
  CHECK(sound.at("views") == 4);
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

TEST_CASE(
    "info says what every grid holds: three numbers of colours, voxels of each class, and what the map is made of") {
  const Maps maps;
  Map map = random_map({.seed = 1, .blocks = 4, .classes = 2, .instances = true});
  Property friction;
  friction.name = "friction";
  friction.support_lo = 0;
  friction.priors = {{"class 1", {0.4, 0.05, 50}}};
  map.properties = PropertyTable({friction});
  save_map(map, maps.a);
  const CommandResult result = run_feltmap("info --json --grids " + maps.a);
  REQUIRE(result.exit_code == 0);
  const auto info = nlohmann::json::parse(result.out);
  std::array<double, 3> greatest{}, sum{};
  std::set<int> instances;
  double most = 0, counts = 0, counted = 0, observed = 0;
  for (const Block& block : map.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      observed += block.geometry->weight[i] > 0;
      if (block.instance != nullptr && block.instance->id[i] > 0) instances.insert(block.instance->id[i]);
      if (block.color == nullptr) continue;
      const double rgb[] = {block.color->r[i] / 65280.0, block.color->g[i] / 65280.0, block.color->b[i] / 65280.0};
      for (size_t c = 0; c < 3; ++c) greatest[c] = std::max(greatest[c], rgb[c]), sum[c] += rgb[c];
      most = std::max(most, double(block.color->count[i]));
      counts += block.color->count[i], counted += block.color->count[i] > 0;
    }
  const auto& grids = info.at("grids");
  for (size_t c = 0; c < 3; ++c) {
    CHECK(grids.at("color").at("least").at(c) == 0);
    CHECK(grids.at("color").at("greatest").at(c).get<double>() == Approx(greatest[c]));
    CHECK(grids.at("color").at("mean").at(c).get<double>() == Approx(sum[c] / observed));
  }
  CHECK(grids.at("color_count").at("greatest") == most);
  CHECK(grids.at("color_count").at("mean").get<double>() == Approx(counts / counted));
  CHECK(grids.at("instance").at("instances") == instances.size());
  const auto& classes = grids.at("label").at("voxels_of_class");
  CHECK(classes.at("class 0").get<int>() > 0);
  CHECK(classes.at("class 0").get<int>() + classes.at("class 1").get<int>() == grids.at("label").at("active_voxels"));
  CHECK(info.at("format_version") == kMapFileVersion);
  REQUIRE(info.at("recordings").size() == map.frames.runs.size());
  CHECK(info.at("recordings").at(0).at("recording") == "0123abcd");
  CHECK(info.at("recordings").at(0).at("frames") == nlohmann::json({{0, 2, 10}, {55, 1, 1}}));
  CHECK(info.at("properties").at(0).at("name") == "friction");
  CHECK(info.at("properties").at(0).at("at_least") == 0);
  CHECK_FALSE(info.at("properties").at(0).contains("at_most"));
  CHECK(info.at("properties").at(0).at("priors").at("class 1").at("mean") == 0.4);
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
  save_map(Map(0.021, 0.08), maps.out);
  const CommandResult other_voxels = run_feltmap("diff --json " + maps.a + " " + maps.out);
  CHECK(other_voxels.exit_code == 1);
  for (const char* uncounted : {"blocks", "channels", "class_flips", "touches"})
    CHECK(nlohmann::json::parse(other_voxels.out).at(uncounted).is_null());
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

TEST_CASE("merging keeps the cap that the maps' class evidence was made with, unless another is given") {
  const Maps maps;
  const auto save = [](const std::string& file, uint64_t seed, int cap) {
    Map map = random_map({.seed = seed, .blocks = 4, .classes = 2, .shared_evidence = true});
    map.frames = {};
    record_frame(map.frames, "recording " + std::to_string(seed), nlohmann::json{{"label_cap", cap}}.dump(), 0);
    save_map(map, file);
  };
  const auto most_evidence = [&](const std::string& options) {
    REQUIRE(run_feltmap("merge " + maps.a + " " + maps.b + " --force --out " + maps.out + options).exit_code == 0);
    const Map map = load_map(maps.out);
    double most = 0;
    for (const Block& block : map.store.blocks())
      for (int i = 0; i < kBlockVoxels; ++i) most = std::max(most, total_evidence(block, i));
    return most;
  };
  save(maps.a, 1, 6);
  save(maps.b, 2, 6);
  CHECK(most_evidence("") == Approx(6));
  CHECK(most_evidence(" --label-cap 3") == Approx(3));
  CHECK(most_evidence(" --label-cap 0") > 20);
  save(maps.b, 2, 7);
  const CommandResult two_caps = run_feltmap("merge " + maps.a + " " + maps.b + " --out " + maps.out);
  CHECK(two_caps.exit_code == 3);
  CHECK_THAT(two_caps.err, Contains("cap of class evidence") && Contains("--label-cap"));
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
