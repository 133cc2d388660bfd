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

namespace {

/// Everything equal, but numbers that are not whole within 1e-6 of 1 or of their size: entropies and probabilities come
/// from functions of the standard library, which round as they like.
void check_summary(const json& found, const json& expected) {
  const json a = found.flatten(), b = expected.flatten();
  REQUIRE(b.contains("/map_hash"));
  CHECK(a.size() == b.size());
  for (const auto& [key, value] : b.items()) {
    INFO(key);
    REQUIRE(a.contains(key));
    if (value.is_number_float())
      CHECK(a.at(key).get<double>() == Approx(value.get<double>()).epsilon(1e-6).margin(1e-6));
    else
      CHECK(a.at(key) == value);
  }
}

}  // namespace

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
    check_summary(json::parse(std::ifstream(made / "summary.json")),
                  json::parse(std::ifstream(entry.path() / "summary.json")));
    ++scenes;
  }
  CHECK(scenes == 3);
}
