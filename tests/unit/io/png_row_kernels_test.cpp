#include "io/images/png_row_kernels.h"

#include <catch2/catch.hpp>
#include <random>
#include <vector>

#include "tests/support/simd_targets.h"

using namespace felt;

TEST_CASE("rows of Paeth's filter together give the bytes of each alone, on every SIMD target") {
  std::mt19937 random(5);
  for (const int pixel_bytes : {1, 2, 3, 4, 6, 8})
    for (const int width : {1, 3, 7, 8, 9, 33, 200})
      for (const int count : {2, 3, 4}) {
        INFO(pixel_bytes << " bytes, " << width << " pixels, " << count << " rows");
        const size_t bytes = size_t(width) * size_t(pixel_bytes), stride = bytes + 1;
        std::vector<uint8_t> filtered(stride * size_t(count + 1) + 1);
        // Small and large steps, so that each of the three predictions is often the nearest, and ties occur.
        for (uint8_t& byte : filtered) byte = uint8_t(random() % 4 != 0 ? random() % 3 : random());
        std::vector<uint8_t> expected = filtered;
        for (int r = 1; r <= count; ++r)
          unfilter_row(4, &expected[size_t(r) * stride], &expected[size_t(r - 1) * stride], bytes, pixel_bytes);
        test::on_every_simd_target([&](const std::string& target) {
          INFO(target);
          std::vector<uint8_t> together = filtered;
          unfilter_paeth_rows(&together[stride], stride, count, bytes, pixel_bytes);
          CHECK(together == expected);
        });
      }
}

TEST_CASE("a row that is unfiltered from the middle on ends as if from the start") {
  std::mt19937 random(6);
  for (const int filter : {1, 2, 3, 4})
    for (const int pixel_bytes : {1, 2, 3, 4, 6, 8}) {
      const size_t bytes = 20 * size_t(pixel_bytes), half = 7 * size_t(pixel_bytes);
      std::vector<uint8_t> above(bytes), row(bytes);
      for (size_t i = 0; i < bytes; ++i) above[i] = uint8_t(random()), row[i] = uint8_t(random());
      std::vector<uint8_t> whole = row;
      unfilter_row(filter, whole.data(), above.data(), bytes, pixel_bytes);
      unfilter_row(filter, row.data(), above.data(), half, pixel_bytes);
      unfilter_row(filter, row.data(), above.data(), bytes, pixel_bytes, half);
      CHECK(row == whole);
      CHECK(whole != above);
    }
}
