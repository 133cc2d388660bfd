#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "tests/cli/command.h"
#include "tests/support/data.h"

namespace felt::test {

TEST_CASE("bench times a sequence at each voxel size and says what the map holds") {
  const std::string room = (source_dir() / "data/scenes/room").string();
  const CommandResult result =
      run_feltmap("bench '" + room + "' --voxel-sizes 0.05 0.1 --max-frames 3 --repetitions 1 --threads 1 --json");
  REQUIRE(result.exit_code == 0);
  const auto report = nlohmann::json::parse(result.out);
  CHECK(report["frames"] == 3);
  CHECK(report["decode_ms"] > 0);
  REQUIRE(report["fusion"].size() == 2);
  const auto &fine = report["fusion"][0], &coarse = report["fusion"][1];
  CHECK(fine["voxel_size_m"] == 0.05);
  CHECK(fine["fuse_ms"] > 0);
  CHECK(fine["triangles"] > coarse["triangles"]);
  CHECK(fine["blocks"] > coarse["blocks"]);
}

TEST_CASE("bench refuses a voxel size that is none") {
  const std::string room = (source_dir() / "data/scenes/room").string();
  for (const char* size : {"0", "inf", "nan"}) {
    const CommandResult result = run_feltmap("bench '" + room + "' --voxel-sizes " + size);
    INFO(size);
    CHECK(result.exit_code == 2);
    CHECK_THAT(result.err, Catch::Matchers::Contains("--voxel-sizes"));
  }
}

}  // namespace felt::test
