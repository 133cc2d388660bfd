#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/map_file/map_diff_report.h"
#include "io/map_file/map_file.h"
#include "tests/support/data.h"

namespace fs = std::filesystem;
using nlohmann::json;

TEST_CASE("the stored scenes give the expected maps") {
  const felt::test::TemporaryDirectory directory;
  const fs::path root = felt::test::source_dir(), expected = root / "data" / "expected";
  std::ostringstream line;
  line << (root / "scripts" / "make_expected") << " " << felt::test::command() << " " << directory.path();
  REQUIRE(std::system(line.str().c_str()) == 0);
  int scenes = 0;
  for (const auto& entry : fs::directory_iterator(expected)) {
    const fs::path made = directory.path() / entry.path().filename();
    const felt::MapDifference d =
        felt::difference(felt::load_map(entry.path() / "map.vdb"), felt::load_map(made / "map.vdb"));
    INFO(entry.path().filename() << ", expected (A) and made (B):\n"
                                 << felt::to_text(d) << "If this is meant: scripts/approve --yes");
    CHECK_FALSE(felt::beyond(d, 0));
    CHECK(d.same_hash);
    CHECK(json::parse(std::ifstream(entry.path() / "summary.json")) ==
          json::parse(std::ifstream(made / "summary.json")));
    ++scenes;
  }
  CHECK(scenes == 3);
}
