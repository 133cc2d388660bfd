#include "core/utf8.h"

#include <catch2/catch.hpp>
#include <string>

#include "core/class_table.h"
#include "core/error.h"
#include "core/property_table.h"

namespace felt::test {

TEST_CASE("UTF-8 is told from other bytes") {
  using namespace std::string_literals;
  for (const std::string& good :
       {""s, "ice"s, "a\0b"s, "\x7f"s, "\xc2\x80"s, "\xdf\xbf"s, "\xe0\xa0\x80"s, "\xed\x9f\xbf"s, "\xee\x80\x80"s,
        "\xef\xbf\xbf"s, "\xf0\x90\x80\x80"s, "\xf4\x8f\xbf\xbf"s}) {
    INFO(good);
    CHECK(is_utf8(good));
    CHECK(is_utf8("x" + good + "y"));
  }
  for (const std::string& bad : {"\x80"s, "\x85"s, "\xbf"s, "\xc0\x80"s, "\xc1\xbf"s, "\xc2"s, "\xc2x"s,
                                 "\xe0\x9f\xbf"s, "\xe2\x82"s, "\xed\xa0\x80"s, "\xf0\x8f\xbf\xbf"s, "\xf0\x90\x80"s,
                                 "\xf4\x90\x80\x80"s, "\xf5\x80\x80\x80"s, "\xf8\x88\x80\x80\x80"s, "\xff"s}) {
    INFO(int(uint8_t(bad[0])));
    CHECK_FALSE(is_utf8(bad));
    CHECK_FALSE(is_utf8("x" + bad + "y"));
  }
}

TEST_CASE("tables refuse names that are no UTF-8, which a map could not be saved with") {
  CHECK_THROWS_WITH(ClassTable({{1,
                                 "i\x85"
                                 "e",
                                 {},
                                 false}}),
                    Catch::Contains("name of id 1") && Catch::Contains("UTF-8"));
  Property friction;
  friction.name = "friction";
  friction.unit = "\xa0";
  CHECK_THROWS_WITH(PropertyTable({friction}), Catch::Contains("friction") && Catch::Contains("unit"));
  friction.unit = "";
  friction.priors["\x85"] = {0.3, 0.1, 5};
  CHECK_THROWS_WITH(PropertyTable({friction}), Catch::Contains("names of classes"));
}

}  // namespace felt::test
