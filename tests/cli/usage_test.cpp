#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "io/map_file/map_file.h"
#include "tests/cli/command.h"
#include "tests/support/data.h"

namespace felt::test {

TEST_CASE("the version is printed on stdout") {
  const CommandResult result = run_feltmap("--version");
  CHECK(result.exit_code == 0);
  CHECK_THAT(result.out, Catch::Matchers::Matches("feltmap [0-9]+\\.[0-9]+\\.[0-9]+ \\(SIMD: [a-z0-9]+\\)\n"));
  CHECK(result.err.empty());
}

TEST_CASE("the SIMD target can be chosen by the environment, and a wrong one is refused") {
  REQUIRE(setenv("FELTMAP_SIMD", "scalar", 1) == 0);
  CHECK_THAT(run_feltmap("--version").out, Catch::Matchers::EndsWith("(SIMD: scalar)\n"));
  REQUIRE(setenv("FELTMAP_SIMD", "mmx", 1) == 0);
  const CommandResult wrong = run_feltmap("--version");
  CHECK(wrong.exit_code == 3);
  CHECK_THAT(wrong.err, Catch::Matchers::Contains("FELTMAP_SIMD") && Catch::Matchers::Contains("mmx"));
  REQUIRE(unsetenv("FELTMAP_SIMD") == 0);
}

TEST_CASE("a command line that makes no sense exits with 2 and one line on stderr") {
  for (const char* arguments : {"", "no-such-command", "--no-such-option"}) {
    INFO("feltmap " << arguments);
    const CommandResult result = run_feltmap(arguments);
    CHECK(result.exit_code == 2);
    CHECK(result.out.empty());
    CHECK_THAT(result.err, Catch::Matchers::StartsWith("feltmap: error: "));
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
  }
}

TEST_CASE("an unknown command is named beside those there are") {
  const CommandResult result = run_feltmap("frobnicate --json");
  CHECK(result.exit_code == 2);
  CHECK_THAT(result.err, Catch::Matchers::StartsWith("feltmap: error: 'frobnicate': expected one of reconstruct, ") &&
                             Catch::Matchers::EndsWith(" (see feltmap --help)\n"));
  CHECK_THAT(result.err, Catch::Matchers::Contains("friction"));
}

TEST_CASE("an option that is nearly one of the command's is answered with that one") {
  for (const char* arguments : {"reconstruct x --out y --voxelsize 3", "reconstruct x --voxelsize=3"}) {
    INFO(arguments);
    const CommandResult result = run_feltmap(arguments);
    CHECK(result.exit_code == 2);
    CHECK(result.err ==
          "feltmap: error: reconstruct: option: expected '--voxel-size', found '--voxelsize' (see feltmap --help)\n");
  }
  CHECK_THAT(run_feltmap("touch map.vdb --fil x").err, Catch::Matchers::Contains("expected '--file', found '--fil'"));
  const CommandResult unlike = run_feltmap("reconstruct x --out y --zzzzzzzz 3");
  CHECK(unlike.exit_code == 2);
  CHECK_THAT(unlike.err, Catch::Matchers::Contains("--zzzzzzzz") && !Catch::Matchers::Contains("expected '"));
}

TEST_CASE("a choice that there is not is answered with those that there are") {
  const CommandResult result = run_feltmap("reconstruct x --out y --distance 1");
  CHECK(result.exit_code == 2);
  CHECK_THAT(result.err, Catch::Matchers::Contains("--distance: 1 not in {optical-axis,ray,tangent-plane}"));
}

TEST_CASE("a switch that is neither on nor off is named") {
  for (const char* value : {"maybe", "99999999999999999999"}) {
    const CommandResult result = run_feltmap(std::string("reconstruct x --out y --bgr=") + value);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Catch::Matchers::Contains(std::string("--bgr: expected true or false, found '") + value));
    const CommandResult negated = run_feltmap(std::string("reconstruct x --out y --no-ray-length=") + value);
    CHECK(negated.exit_code == 2);
    CHECK_THAT(negated.err,
               Catch::Matchers::Contains(std::string("--no-ray-length: expected true or false, found '") + value));
  }
  CHECK(run_feltmap("reconstruct x --out y --ray-length --no-ray-length").exit_code == 2);
}

TEST_CASE("words of the command line that cannot be read are faults of it, whatever the command") {
  const std::string room = (source_dir() / "data/scenes/room").string();
  for (const std::string& command :
       {"reconstruct " + room + " --out x", "doctor " + room, "info " + room, "convert " + room + " --out x",
        "segment " + room + " --out x --vote geometric", "calibrate-labels " + room + " --reference-labels y --out x",
        "evaluate x.vdb --reference-labels " + room, "render x.vdb --out x --trajectory " + room}) {
    const CommandResult frames = run_feltmap(command + " --frames 5");
    INFO(command << ": " << frames.err);
    CHECK(frames.exit_code == 2);
    CHECK_THAT(frames.err, Catch::Matchers::Contains("--frames: frames: expected a:b:step, found '5'"));
    const CommandResult format = run_feltmap(command + " --format foo");
    CHECK(format.exit_code == 2);
    CHECK_THAT(format.err, Catch::Matchers::Contains("--format: layout: expected one of ") &&
                               Catch::Matchers::Contains("found 'foo'"));
  }
}

TEST_CASE("options that a map or a recording has no use for are named") {
  const std::string scene = (source_dir() / "data/scenes/room").string();
  const TemporaryDirectory folder;
  const std::string map = (folder.path() / "map.vdb").string();
  Map empty(0.05, 0.2);
  save_map(empty, map);
  const auto refused = [](const std::string& arguments, const std::string& option) {
    const CommandResult result = run_feltmap(arguments);
    INFO(arguments << ": " << result.err);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Catch::Matchers::Contains(option));
  };
  refused("info " + map + " --frames 0:3", "--frames: what to describe: expected a sequence");
  refused("info " + map + " --pictures " + folder.path().string(), "--pictures");
  refused("info " + scene + " --grids", "--grids: what to describe: expected a map");
  refused("touch " + map + " --file x.csv --mask y.png", "--mask");
  refused("touch " + map + " --sequence x --frame 1 --pixel 1,1 --property p --value 1 --pose 1", "--pose");
  refused("region " + map +
              " --at 0,0,0 --region mask --mask x.png --intrinsics 1,1,1,1 --pose 2,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1",
          "--pose: matrix: expected a rigid transform");
  refused("friction x.csv --normal 0,0,0", "--normal: expected a direction x,y,z, found '0,0,0'");
  refused("render " + map + " --overview x.png --up 0,0,nan", "--up: expected a direction");
  refused("infer --fit-priors x.csv --properties-out x.yaml --support nan 1", "--support: range");
}

TEST_CASE("numbers that cannot be used are repeated as they were given, each once") {
  const auto refused = [](const std::string& options, const std::string& found) {
    const CommandResult result = run_feltmap("reconstruct x --out y " + options);
    CHECK(result.exit_code == 3);
    CHECK_THAT(result.err, Catch::Matchers::EndsWith("found " + found + "\n"));
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
  };
  refused("--depth-scale 0", "0");
  refused("--max-dt=-0.5", "-0.5");
  refused("--stamp-offset nan", "nan");
  refused("--label-band nan", "nan");
  refused("--label-cap=-1", "-1");
}

TEST_CASE("help names what is given, shows defaults that hold, and examples whose files are there") {
  const auto help = [](const std::string& command) { return run_feltmap(command + " --help").out; };
  using Catch::Matchers::Contains;
  for (const char* command : {"touch", "region", "query", "suggest", "export", "render", "verify"}) {
    INFO(command);
    CHECK_THAT(help(command), Contains(std::string("feltmap ") + command + " [OPTIONS] MAP") && !Contains("Excludes"));
  }
  CHECK_THAT(help("friction"), Contains("[OPTIONS] LOG"));
  CHECK_THAT(help("touch"), Contains("--intrinsics FLOAT x 4 or 6"));
  CHECK_THAT(help("infer"), Contains("--precision TEXT:{f32,f64}=f64"));
  const std::string reconstruct = help("reconstruct");
  CHECK_THAT(reconstruct, Contains("--vote TEXT:{geometric,instances,none}=none"));
  for (const char* shown :
       {"measured along [ray]", "measurement [constant]", "weight [255]", "a frame, seconds [0.02]"})
    CHECK_THAT(reconstruct, Contains(shown));
  CHECK_THAT(help("evaluate"), !Contains("525") && !Contains("640x480") && Contains("required where --trajectory"));
  CHECK_THAT(help("render"), Contains("--size TEXT=640x480"));
  const std::string network = "data/confusion/ice_is_snow.csv";
  CHECK_THAT(help("simulate"), Contains("--network " + network));
  CHECK(std::filesystem::exists(source_dir() / network));
}

TEST_CASE("the doctor accuses none of the sequences that simulate makes") {
  const test::TemporaryDirectory folder;
  // Few views that hardly overlap, along plain walls and without noise: what a search for faults can be misled by.
  for (const std::string scene : {"room1 --frames 5", "room1 --frames 3 --trajectory orbit", "room3 --frames 4",
                                  "boxes --frames 6 --trajectory sweep", "door --frames 6 --trajectory orbit"}) {
    INFO(scene);
    const std::string sequence = (folder.path() / "made").string();
    REQUIRE(
        run_feltmap("simulate " + scene + " --width 160 --height 120 --no-mesh --force --out " + sequence).exit_code ==
        0);
    const CommandResult result = run_feltmap("doctor " + sequence);
    INFO(result.out);
    CHECK(result.exit_code == 0);
  }
}

TEST_CASE("doctor examines the frames that were asked for") {
  const CommandResult result =
      run_feltmap("doctor " + (source_dir() / "data/scenes/room").string() + " --frames 3:8 --json");
  INFO(result.err);
  const nlohmann::json json = nlohmann::json::parse(result.out);
  CHECK(json["frames"] == 24);
  CHECK(json["selected_frames"] == 5);
  CHECK(json["sampled_frames"] == 5);
}

TEST_CASE("help that cannot be written is an error of output") {
  const CommandResult result = run_feltmap_within("", "--help", " >/dev/full");
  CHECK(result.exit_code == 4);
  CHECK_THAT(result.err, Catch::Matchers::Contains("standard output: cannot be written"));
}

TEST_CASE("a seed below zero and depths in the wrong order are refused") {
  CHECK(run_feltmap("simulate room --out x --seed=-1").exit_code == 2);
  const CommandResult result = run_feltmap("evaluate x.vdb --reference-mesh y.ply --min-depth 5 --max-depth 4");
  CHECK(result.exit_code == 3);
  CHECK_THAT(result.err, Catch::Matchers::Contains("expected a number above --min-depth, 5.0, found 4.0"));
}

TEST_CASE("an option that a shell left without a value is named, and does not take the next word") {
  const CommandResult result = run_feltmap("reconstruct x --out= --force");
  CHECK(result.exit_code == 2);
  CHECK_THAT(result.err, Catch::Matchers::Contains("'--out=': expected a value"));
}

TEST_CASE("an empty word is no value, whatever the option") {
  const auto refuses = [](const std::string& arguments, const std::string& what) {
    const CommandResult result = run_feltmap(arguments);
    INFO(arguments << "\n" << result.out << result.err);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Catch::Matchers::Contains("'" + what + "': expected a value, found none"));
    CHECK(result.out.empty());
  };
  refuses("export map.vdb --mesh out.ply --class ''", "--class \"\"");
  refuses("query map.vdb --json --file ''", "--file \"\"");
  refuses("touch map.vdb --undo ''", "--undo \"\"");
  refuses("info ''", "\"\"");
}

}  // namespace felt::test
