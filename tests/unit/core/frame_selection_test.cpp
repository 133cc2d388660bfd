#include "core/frame_selection.h"

#include <catch2/catch.hpp>

#include "core/error.h"

using namespace felt;

TEST_CASE("frames a:b:step reads like a slice and writes back as it was read") {
  CHECK(selected_positions(parse_frame_selection("2:9:3", "--frames"), 100) == std::vector<int64_t>{2, 5, 8});
  CHECK(selected_positions(parse_frame_selection(":3", "--frames"), 100) == std::vector<int64_t>{0, 1, 2});
  CHECK(selected_positions(parse_frame_selection("3:", "--frames"), 5) == std::vector<int64_t>{3, 4});
  CHECK(selected_positions(parse_frame_selection("::2", "--frames"), 5) == std::vector<int64_t>{0, 2, 4});
  CHECK(selected_positions(parse_frame_selection("7:", "--frames"), 5).empty());
  CHECK(selected_positions(parse_frame_selection("1::9223372036854775807", "--frames"), 5) == std::vector<int64_t>{1});
  for (const char* text : {"2:9:3", "0::1", "4::2"}) CHECK(to_string(parse_frame_selection(text, "--frames")) == text);
}

TEST_CASE("anything that is no a:b:step of whole numbers is refused and named") {
  for (const char* text :
       {"", "5", "a:b", "1:2:3:4", "-1:4", "3:2", "1:5:0", "1:5:-1", "1.5:2", "1:2x", "99999999999999999999:"})
    CHECK_THROWS_WITH(parse_frame_selection(text, "--frames"), Catch::Contains("--frames") && Catch::Contains(text));
}
