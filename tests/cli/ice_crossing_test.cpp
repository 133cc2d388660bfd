// The ice crossing of Ewen et al. 2024, in a map and through the commands: a network calls the ice snow, or concrete,
// in 50 frames; one touch says how it feels.
#include <catch2/catch.hpp>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "io/files/atomic_file.h"
#include "tests/cli/command.h"
#include "tests/cli/sequences.h"
#include "tests/support/data.h"

namespace felt::test {
namespace {

using nlohmann::json;

json answer_of(const std::string& arguments) {
  const CommandResult result = run_feltmap(arguments);
  INFO(arguments << "\n" << result.err);
  REQUIRE(result.exit_code == 0);
  return json::parse(result.out);
}

/// The stored network that takes ice for snow, or one that takes it for concrete.
std::string network(const std::string& folder, const std::string& taken_for) {
  const std::string stored = (source_dir() / "data/confusion/ice_is_snow.csv").string();
  if (taken_for == "snow") return stored;
  std::ifstream file(stored);
  std::string text{std::istreambuf_iterator<char>(file), {}};
  const std::string row = "ice,0,0,0,0,0,0,1,0", other = "ice,1,0,0,0,0,0,0,0";
  REQUIRE(text.find(row) != std::string::npos);
  text.replace(text.find(row), row.size(), other);
  write_file_atomically(folder + "/network.csv", text);
  return folder + "/network.csv";
}

}  // namespace

TEST_CASE("ice that 50 frames call snow or concrete is walked statically after one slippery touch") {
  const TemporaryDirectory temporary;
  const std::string folder = temporary.path().string();
  for (const std::string taken_for : {"snow", "concrete"}) {
    INFO("ice taken for " << taken_for);
    const std::string sequence = folder + "/" + taken_for, out = folder + "/map_of_" + taken_for;
    REQUIRE(run_feltmap("simulate ice_crossing --out " + sequence +
                        " --frames 50 --width 120 --height 90 --labels material --errors scene --no-mesh --quiet "
                        "--network " +
                        network(folder, taken_for))
                .exit_code == 0);
    const json report = answer_of("reconstruct " + sequence + " --out " + out + " --voxel-size 0.04 --quiet --json");
    CHECK(report["frames"]["fused"] == 50);
    const std::string map = out + "/map.vdb", at = " --at 0,0,0 ";
    const json before = answer_of("region " + map + at + "--below 0.25 --json");
    CHECK(before["belief"]["class"] == taken_for);
    CHECK(before["belief"]["properties"]["friction"]["gait"]["decision"] == "dynamic");
    for (const double reading : {0.139, 0.156, 0.628}) {
      INFO("reading " << reading);
      const json touched = answer_of("touch " + map + at + "--property friction --value " + std::to_string(reading) +
                                     " --out " + out + "/touched.vdb --json");
      const json after = answer_of("region " + out + "/touched.vdb" + at + "--below 0.25 --json");
      const json friction = after["belief"]["properties"]["friction"];
      CHECK(friction["mean"] == touched["after"]["properties"]["friction"]["mean"]);
      if (reading < 0.25) {
        CHECK(friction["mean"].get<double>() <= 0.25);
        CHECK(friction["gait"]["decision"] == "static");
        CHECK(friction["below"]["probability"].get<double>() > 0.5);
        CHECK(after["belief"]["class"] == "ice");
      } else {
        CHECK(friction["mean"].get<double>() > 0.25);
        CHECK(friction["gait"]["decision"] == "dynamic");
      }
    }
  }
}

TEST_CASE(
    "however long ice was taken for snow, one touch corrects it, because evidence has a cap unless told otherwise") {
  const TemporaryDirectory temporary;
  const std::string folder = temporary.path().string();
  REQUIRE(run_feltmap("simulate ice_crossing --out " + folder +
                      "/five --frames 5 --width 60 --height 45 --labels material --errors scene --no-mesh --quiet "
                      "--network " +
                      network(folder, "snow"))
              .exit_code == 0);
  const std::string long_sequence = repeated(folder + "/five", folder + "/long", 60).string();
  for (const std::string cap : {"", " --label-cap 0"}) {
    INFO("reconstruct" << cap);
    const std::string map = folder + "/out/map.vdb";
    const json report =
        answer_of("reconstruct " + long_sequence + " --out " + folder + "/out --voxel-size 0.08 --force --json" + cap);
    CHECK(report["frames"]["fused"] == 300);
    const json touched = answer_of("touch " + map + " --at 0,0,0 --property friction --value 0.156 --dry-run --json");
    CHECK(touched["before"]["class"] == "snow");
    CHECK(touched["after"]["class"] == (cap.empty() ? "ice" : "snow"));
  }
}

}  // namespace felt::test
