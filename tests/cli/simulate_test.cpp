#include <catch2/catch.hpp>
#include <filesystem>
#include <fstream>

#include "tests/cli/command.h"
#include "tests/support/data.h"
#include "tests/support/folder_content.h"

namespace fs = std::filesystem;
using felt::test::files_of;
using felt::test::run_feltmap;
using felt::test::TemporaryDirectory;

namespace {

std::string quoted(const fs::path& path) { return std::string(" '").append(path.string()).append(1, '\''); }

const std::string kSmall =
    "simulate boxes --frames 3 --width 64 --height 48 --noise rgbd --network poor --top 2 "
    "--labels material --touches 2 --out";

}  // namespace

TEST_CASE("simulate lists its scenes") {
  const auto result = run_feltmap("simulate --list");
  CHECK(result.exit_code == 0);
  for (const char* name : {"plane", "sphere", "boxes", "ice_crossing", "room1", "room5"})
    CHECK_THAT(result.out, Catch::Contains(name));
}

TEST_CASE("simulate writes every file of the layout, the same bytes for any number of threads") {
  const TemporaryDirectory directory;
  const auto one = run_feltmap(kSmall + quoted(directory.path() / "one") + " --threads 1");
  INFO(one.err);
  REQUIRE(one.exit_code == 0);
  REQUIRE(run_feltmap(kSmall + quoted(directory.path() / "three") + " --threads 3").exit_code == 0);
  const auto files = files_of(directory.path() / "one");
  for (const char* name :
       {"sequence.yaml", "poses.txt", "classes.yaml", "properties.yaml", "touches.csv", "confusion.csv", "scene.json",
        "mesh.ply", "color/000002.png", "depth/000002.png", "labels/000000.png", "probs/000001.png",
        "instances/000002.png", "truth/sequence.yaml", "truth/semantic/000002.png", "truth/material/000002.png"})
    CHECK(files.count(name) == 1);
  CHECK(files == files_of(directory.path() / "three"));
  CHECK(std::distance(fs::directory_iterator(directory.path()), fs::directory_iterator()) == 2);
}

TEST_CASE("simulate says which touches a reconstruction cannot use as they are, and which cannot be made") {
  const TemporaryDirectory directory;
  const std::string small = "simulate boxes --frames 2 --width 64 --height 48 --touches 2 --no-mesh --force --out" +
                            quoted(directory.path() / "out");
  const auto things = run_feltmap(small);
  CHECK(things.exit_code == 0);
  CHECK_THAT(things.err, Catch::Contains("--touches") && Catch::Contains("reconstruct needs --properties"));
  CHECK(run_feltmap(small + " --labels material").err.empty());
  const fs::path table = directory.path() / "properties.yaml";
  std::ofstream(table) << "stiffness: {unit: N/m, priors: {jelly: {mean: 5, sd: 1, readings: 9}}}\n";
  const auto none = run_feltmap(small + " --labels material --properties" + quoted(table));
  CHECK(none.exit_code == 0);
  CHECK_THAT(none.err, Catch::Contains("no material of the scene has a prior of stiffness"));
}

TEST_CASE("an edited scene file is rendered like a built-in scene") {
  const TemporaryDirectory directory;
  const std::string small = " --frames 1 --width 64 --height 48 --out";
  REQUIRE(run_feltmap("simulate boxes" + small + quoted(directory.path() / "a")).exit_code == 0);
  const auto again =
      run_feltmap("simulate" + quoted(directory.path() / "a" / "scene.json") + small + quoted(directory.path() / "b"));
  INFO(again.err);
  REQUIRE(again.exit_code == 0);
  CHECK(files_of(directory.path() / "a").at("depth/000000.png") ==
        files_of(directory.path() / "b").at("depth/000000.png"));
}

TEST_CASE("simulate replaces an earlier simulation only when told, and nothing else at all") {
  const TemporaryDirectory directory;
  const fs::path out = directory.path() / "out", mine = directory.path() / "mine";
  REQUIRE(run_feltmap(kSmall + quoted(out)).exit_code == 0);
  const auto refused = run_feltmap(kSmall + quoted(out));
  CHECK(refused.exit_code == 4);
  CHECK_THAT(refused.err, Catch::Contains("--force"));
  CHECK(run_feltmap("simulate plane --frames 1 --width 64 --height 48 --force --out" + quoted(out)).exit_code == 0);
  CHECK(files_of(out).count("color/000002.png") == 0);

  fs::create_directory(mine);
  std::ofstream(mine / "thesis.txt") << "years of work";
  CHECK(run_feltmap(kSmall + quoted(mine) + " --force").exit_code == 4);
  CHECK(files_of(mine).at("thesis.txt") == "years of work");
  CHECK(std::distance(fs::directory_iterator(directory.path()), fs::directory_iterator()) == 2);
  // Not even what somebody put beside an earlier one.
  std::ofstream(out / "notes.txt") << "mine";
  const auto kept = run_feltmap(kSmall + quoted(out) + " --force");
  CHECK(kept.exit_code == 4);
  CHECK_THAT(kept.err, Catch::Contains("notes.txt"));
  CHECK(fs::exists(out / "notes.txt"));
}

TEST_CASE("what simulate cannot do is refused with the reason and its exit code, and leaves nothing") {
  const TemporaryDirectory directory;
  const auto expect = [&](const std::string& arguments, int code, const std::string& reason) {
    const auto result = run_feltmap("simulate " + arguments);
    INFO(arguments << ": " << result.err);
    CHECK(result.exit_code == code);
    CHECK_THAT(result.err, Catch::Contains(reason));
    CHECK(fs::is_empty(directory.path()));
  };
  const std::string out = " --out" + quoted(directory.path() / "out");
  expect("", 2, "SCENE");
  expect("boxes", 2, "--out");
  expect("boxes --frames 0" + out, 2, "--frames");
  expect("castle" + out, 3, "room1");
  expect("boxes --network perfect" + out, 3, "'perfect'");
  expect("boxes --top 3" + out, 2, "--network");
  expect("boxes --touches 1 --touch-where mistaken" + out, 2, "--labels material");
  for (const char* idle : {"--errors pixel", "--sharpness 3", "--touch-sigma 1", "--touch-where anywhere"})
    expect("boxes " + std::string(idle) + out, 2, std::string(idle).substr(0, std::string(idle).find(' ')));
  expect("boxes --network nowhere.csv" + out, 4, "nowhere.csv");
  expect("nowhere.yaml" + out, 4, "nowhere.yaml");
  expect("boxes --out" + quoted(directory.path() / "missing" / "out"), 4, "missing");
  expect("sphere --trajectory orbit" + out, 3, "trajectory");
}
