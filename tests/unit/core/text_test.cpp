#include "core/text.h"

#include <catch2/catch.hpp>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "core/property_table.h"

namespace felt::test {

TEST_CASE("numbers read as printf writes them, however long") {
  CHECK(number_text(0.25) == "0.25");
  CHECK(number_text(1.0 / 3) == "0.333333");
  CHECK(number_text(1e15) == "1e+15");
  CHECK(number_text(-std::numeric_limits<double>::infinity()) == "-inf");
  CHECK(number_text(1.0 / 3, "%.3g") == "0.333");
  CHECK(number_text(0.1, "%.17g") == "0.10000000000000001");
  CHECK(number_text(1e300, "%.0f").size() == 301);
}

TEST_CASE("a list names its items in order, or the first of them and how many more there are") {
  const std::vector<std::string> names{"ice", "snow", "road"};
  CHECK(listed(std::vector<std::string>{}) == "");
  CHECK(listed(std::vector<std::string>{"ice"}) == "ice");
  CHECK(listed(names) == "ice, snow, road");
  CHECK(listed(std::vector<std::string>{"", "ice"}) == ", ice");
  CHECK(listed(names, {}, 3) == "ice, snow, road");
  CHECK(listed(names, {}, 2) == "ice, snow and 1 more");
  CHECK(listed(
            std::vector<int64_t>{3, 4, 9, 12}, [](int64_t n) { return std::to_string(n); }, 1) == "3 and 3 more");
}

TEST_CASE("a list says its items in other words, by a function or a member") {
  std::vector<Property> properties(2);
  properties[0].name = "friction";
  properties[1].name = "stiffness";
  CHECK(listed(properties, &Property::name) == "friction, stiffness");
  const std::map<std::string, int> choices{{"a", 1}, {"b", 2}};
  CHECK(listed(choices, &std::pair<const std::string, int>::first) == "a, b");
  CHECK(listed(choices, [](const auto& choice) { return std::to_string(choice.second) + ' ' + choice.first; }) ==
        "1 a, 2 b");
}

TEST_CASE("a point is said to the millimetre, and in few digits where it is beyond any place") {
  CHECK(point_text(1, -0.25, 0.0004) == "(1.000, -0.250, 0.000)");
  CHECK(point_text(1e300, 450000.1234, std::nan("")) == "(1e+300, 450000.123, nan)");
}

TEST_CASE("a number in hexadecimal digits has all sixteen") {
  CHECK(hexadecimal(0) == "0000000000000000");
  CHECK(hexadecimal(0x0123456789abcdef) == "0123456789abcdef");
  CHECK(hexadecimal(UINT64_MAX) == "ffffffffffffffff");
}

TEST_CASE("the nearest known word is suggested, and none where nothing is near") {
  CHECK(nearest_word("max_dpeth", {"max_depth", "min_depth", "max_dt"}) == "max_depth");
  CHECK(nearest_word("voxelsize", {"max_depth", "voxel_size"}) == "voxel_size");
  CHECK(nearest_word("VOXEL_SIZE", {"max_depth", "voxel_size"}) == "voxel_size");
  CHECK(nearest_word("zzzz", {"max_depth", "voxel_size"}).empty());
}

}  // namespace felt::test
