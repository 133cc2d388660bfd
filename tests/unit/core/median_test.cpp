#include "core/median.h"

#include <catch2/catch.hpp>

namespace felt::test {

TEST_CASE("the median is the middle value, the upper of two, and 0 of none") {
  CHECK(median({}) == 0);
  CHECK(median({-3}) == -3);
  CHECK(median({2, 1}) == 2);
  CHECK(median({5, -1, 3}) == 3);
  CHECK(median({4, 1, 3, 2}) == 3);
  CHECK(median({1, 1, 1, 9, 9}) == 1);
}

}  // namespace felt::test
