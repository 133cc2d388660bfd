#include "io/images/png_row_kernels.h"

#include <cstdlib>

namespace felt {
namespace {

/// Paeth's predictor: of a left, b above, c above left, the one nearest to a + b - c.
uint8_t paeth(int a, int b, int c) {
  const int to_a = std::abs(b - c), to_b = std::abs(a - c), to_c = std::abs(a + b - 2 * c);
  return uint8_t(to_a <= to_b && to_a <= to_c ? a : to_b <= to_c ? b : c);
}

/// N bytes a pixel, known when compiling, keep the left pixel in registers.
template <int N>
void unfilter(int filter, uint8_t* row, const uint8_t* above, size_t bytes, size_t from) {
  uint8_t left[N] = {}, above_left[N] = {};
  for (int k = 0; from > 0 && k < N; ++k) left[k] = row[from - N + k], above_left[k] = above[from - N + k];
  const size_t whole = bytes - bytes % N;
  switch (filter) {
    case 1:
      for (size_t i = from; i < whole; i += N)
        for (int k = 0; k < N; ++k) row[i + k] = left[k] = uint8_t(row[i + k] + left[k]);
      break;
    case 2:
      for (size_t i = from; i < bytes; ++i) row[i] = uint8_t(row[i] + above[i]);
      break;
    case 3:
      for (size_t i = from; i < whole; i += N)
        for (int k = 0; k < N; ++k) row[i + k] = left[k] = uint8_t(row[i + k] + (left[k] + above[i + k]) / 2);
      break;
    case 4:
      for (size_t i = from; i < whole; i += N)
        for (int k = 0; k < N; ++k) {
          row[i + k] = left[k] = uint8_t(row[i + k] + paeth(left[k], above[i + k], above_left[k]));
          above_left[k] = above[i + k];
        }
      break;
  }
}

}  // namespace

void unfilter_row(int filter, uint8_t* row, const uint8_t* above, size_t bytes, int pixel_bytes, size_t from) {
  using Unfilter = void (*)(int, uint8_t*, const uint8_t*, size_t, size_t);
  constexpr Unfilter kUnfilter[9] = {nullptr, unfilter<1>, unfilter<2>, unfilter<3>, unfilter<4>,
                                     nullptr, unfilter<6>, nullptr,     unfilter<8>};
  kUnfilter[pixel_bytes](filter, row, above, bytes, from);
}

}  // namespace felt
