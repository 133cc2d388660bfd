// Touches recorded with a sequence, through `feltmap reconstruct`.
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "io/files/atomic_file.h"
#include "io/map_file/map_file.h"
#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"

namespace felt::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const std::string kSmall = " --voxel-size 0.04 --no-color --quiet --json ";

std::string room() { return (source_dir() / "data/scenes/room").string(); }

/// The room without what it carries of touches.
std::string bare_room(const fs::path& folder) {
  const fs::path copy = folder / "bare";
  fs::create_directory(copy);
  for (const fs::directory_entry& entry : fs::directory_iterator(room()))
    if (entry.path().filename() != "touches.csv" && entry.path().filename() != "properties.yaml")
      fs::copy(entry.path(), copy / entry.path().filename(), fs::copy_options::recursive);
  return copy.string();
}

json reconstructed(const std::string& arguments) {
  const CommandResult result = run_feltmap("reconstruct " + arguments + kSmall);
  INFO(arguments << "\n" << result.err);
  REQUIRE(result.exit_code == 0);
  return json::parse(result.out);
}

}  // namespace

TEST_CASE("touches that a sequence carries, that are given, and that come afterwards make the same map") {
  const TemporaryDirectory folder;
  const std::string out = folder.path().string(), bare = bare_room(folder.path());
  const json carried = reconstructed(room() + " --out " + out + "/carried");
  CHECK(carried["touches"]["recorded"] == 4);
  CHECK(carried["touches"]["applied"] == 4);
  CHECK(carried["touches"]["refused"].empty());
  CHECK(carried["bytes"]["properties"] > 0);
  const Map map = load_map(out + "/carried/map.vdb");
  REQUIRE(map.touches.touches.size() == 4);
  for (size_t t = 0; t < 4; ++t) CHECK(map.touches.touches[t].request.stamp_s == double(4 + 5 * t));

  const std::string given = " --properties " + room() + "/properties.yaml --touches " + room() + "/touches.csv";
  CHECK(reconstructed(bare + given + " --out " + out + "/given")["map_hash"] == carried["map_hash"]);

  const json untouched = reconstructed(bare + " --out " + out + "/untouched");
  CHECK_FALSE(untouched.contains("touches"));
  CHECK(untouched["map_hash"] != carried["map_hash"]);
  const CommandResult touched = run_feltmap("touch " + out + "/untouched/map.vdb --json --file " + room() +
                                            "/touches.csv --properties " + room() + "/properties.yaml");
  INFO(touched.err);
  REQUIRE(touched.exit_code == 0);
  CHECK(json::parse(touched.out)["map_hash"] == carried["map_hash"]);
}

TEST_CASE("a pixel touch lands where its frame saw it; one of a frame that is not selected is left out") {
  const TemporaryDirectory folder;
  const std::string out = folder.path().string(), csv = out + "/pixels.csv";
  write_file_atomically(csv, "frame,u,v,property,value\n3,96,100,friction,0.4\n20,96,100,friction,0.4\n");
  const json report = reconstructed(bare_room(folder.path()) + " --frames 0:8:2 --properties " + room() +
                                    "/properties.yaml --touches " + csv + " --out " + out + "/map");
  CHECK(report["touches"]["applied"] == 1);
  CHECK(report["touches"]["outside_selection"] == 1);
  const Map map = load_map(out + "/map/map.vdb");
  REQUIRE(map.touches.touches.size() == 1);
  CHECK(map.touches.touches[0].request.stamp_s == 3);
}

TEST_CASE("touches that cannot belong to the sequence are an error before anything is written") {
  const TemporaryDirectory folder;
  const std::string csv = (folder.path() / "touches.csv").string(), out = (folder.path() / "out").string();
  const auto refused = [&](const std::string& rows, const std::string& reason) {
    write_file_atomically(csv, rows);
    const CommandResult result = run_feltmap("reconstruct " + room() + " --touches " + csv + " --out " + out + kSmall);
    INFO(rows);
    CHECK(result.exit_code == 4);
    CHECK_THAT(result.err, Catch::Contains(reason));
    CHECK_FALSE(fs::exists(out));
  };
  refused("frame,x,y,z,property,value\n24,0,0,0,friction,0.3\n",
          "touches.csv:2: touch: frame: expected one of the sequence, 0 to 23, found 24");
  refused("stamp,x,y,z,property,value\n-1,0,0,0,friction,0.3\n",
          "stamp: expected one of the sequence, 0.000000 to 23.000000, found -1.000000");
  refused("stamp,x,y,z,property,value\nnan,0,0,0,friction,0.3\n", "stamp");
  refused("frame,x,y,z,property,value\n3,0,0,0,stiffness,0.3\n", "'stiffness'");
  refused("frame,x,y,z,property,value\n3,0,0,0,friction,-0.3\n", "[0, inf]");
  refused("frame,x,y,z,property,value\n3,0,0,0,friction,nan\n", "value");
  refused("frame,x,y,property,value\n3,0,0,friction,0.3\n", "columns x, y, z or u, v");
  write_file_atomically(csv, "frame,x,y,z,property,value\n3,0,0,0,friction,0.3\n");
  const CommandResult no_table =
      run_feltmap("reconstruct " + bare_room(folder.path()) + " --touches " + csv + " --out " + out + kSmall);
  CHECK(no_table.exit_code == 3);
  CHECK_THAT(no_table.err, Catch::Contains("--properties"));
}

TEST_CASE("touches that an interrupted map was given by hand do not count twice when its run goes on") {
  const TemporaryDirectory folder;
  const std::string out = folder.path().string() + "/map", map_file = out + "/map.vdb";
  const json whole = reconstructed(room() + " --out " + out);
  CHECK(whole["touches"]["already_counted"] == 0);
  // As it would be had the run been stopped behind its last frame, and `touch --file` come before --resume.
  Map map = load_map(map_file);
  json progress = json::parse(map.metadata.at("progress"));
  progress["complete"] = false;
  progress["touches"] = "";
  map.metadata["progress"] = progress.dump();
  save_map(map, map_file);
  const CommandResult result = run_feltmap("reconstruct " + room() + " --out " + out + " --resume" + kSmall);
  INFO(result.err);
  REQUIRE(result.exit_code == 0);
  CHECK_THAT(result.err, Catch::Contains("4 of 4 touches count already"));
  const json report = json::parse(result.out);
  CHECK(report["touches"]["already_counted"] == 4);
  CHECK(report["touches"]["applied"] == 0);
  CHECK(report["touches"]["refused"].empty());
  CHECK(report["map_hash"] == whole["map_hash"]);
}

TEST_CASE("a recorded touch in free space is refused and counted, the others count") {
  const TemporaryDirectory folder;
  const std::string csv = (folder.path() / "touches.csv").string(), out = (folder.path() / "out").string();
  write_file_atomically(csv,
                        "frame,x,y,z,property,value\n4,-0.849140,2.05,0.903078,friction,0.36\n"
                        "5,-0.849140,1.80,0.903078,friction,0.36\n");
  const CommandResult result = run_feltmap("reconstruct " + room() + " --touches " + csv + " --out " + out + kSmall);
  REQUIRE(result.exit_code == 0);
  CHECK_THAT(result.err, Catch::Contains("touches.csv:3"));
  const json touches = json::parse(result.out)["touches"];
  CHECK(touches["applied"] == 1);
  REQUIRE(touches["refused"].size() == 1);
  CHECK(touches["refused"][0]["line"] == 3);
  CHECK(load_map(out + "/map.vdb").touches.touches.size() == 1);
}

TEST_CASE("parts without the recording's touches, merged and then touched, are the map of one run") {
  const TemporaryDirectory folder;
  const fs::path scene = source_dir() / "data" / "scenes" / "ice_crossing", out = folder.path();
  const auto map = [&](const char* name, const std::string& options) {
    REQUIRE(run_feltmap("reconstruct " + quoted(scene) + " --voxel-size 0.05 --quiet --out " + quoted(out / name) +
                        " " + options)
                .exit_code == 0);
    return quoted(out / name / "map.vdb");
  };
  const std::string whole = map("whole", ""), merged = quoted(out / "merged.vdb");
  const std::string parts = map("a", "--no-touches --frames 0:6") + " " + map("b", "--no-touches --frames 6:12");
  REQUIRE(run_feltmap("merge " + parts + " --out " + merged).exit_code == 0);
  CHECK(load_map(out / "merged.vdb").touches.touches.empty());
  REQUIRE(run_feltmap("touch " + merged + " --file " + quoted(scene / "touches.csv") + " --sequence " + quoted(scene))
              .exit_code == 0);
  const json same = json::parse(run_feltmap("diff --json " + whole + " " + merged).out);
  CHECK(same["touches"]["both"] == 3);
  for (const char* other : {"only_a", "only_b", "regions_changed"}) CHECK(same["touches"][other] == 0);
  CHECK(same["class_flips"] == 0);
  for (const auto& [name, channel] : same["channels"].items()) {
    INFO(name);
    // Averages, and weights of fractions, are rounded; counts are equal.
    CHECK(channel["max_difference"] <= (name == "tsdf" ? 1e-6 : name == "weight" ? 1e-4 : name == "color" ? 0.1 : 0));
    CHECK((channel["voxels_only_a"] == 0 && channel["voxels_only_b"] == 0));
  }
}

}  // namespace felt::test
