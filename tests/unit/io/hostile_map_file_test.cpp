#include <catch2/catch.hpp>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <random>

#include "core/error.h"
#include "io/map_file/map_file.h"
#include "tests/support/data.h"
#include "tests/support/random_map.h"

using namespace felt;

TEST_CASE("a map file with any byte changed or any part cut off is refused or loads unchanged") {
  // FELTMAP_CORRUPTIONS=10000 for the long run.
  const char* asked = std::getenv("FELTMAP_CORRUPTIONS");
  const int trials = asked != nullptr ? std::atoi(asked) : 400;
  REQUIRE(trials > 0);
  const test::TemporaryDirectory directory;
  const auto path = directory.path() / "map.vdb";
  const Map map = test::random_map({.seed = 12, .blocks = 2, .classes = 2});
  const std::string hash = map_hash(map);
  save_map(map, path);
  std::ifstream file(path, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(file), {}};
  std::mt19937_64 engine(1);
  int refused = 0, unchanged = 0;
  for (int trial = 0; trial < trials; ++trial) {
    std::string bytes = whole;
    if (trial % 4 == 3)
      bytes.resize(engine() % whole.size());
    else
      bytes[engine() % whole.size()] ^= char(1 + engine() % 255);
    std::ofstream(path, std::ios::binary) << bytes;
    try {
      unchanged += map_hash(load_map(path)) == hash;
    } catch (const FormatError&) {
      ++refused;
    }
  }
  CHECK(refused + unchanged == trials);
  CHECK(refused > trials * 9 / 10);
}
