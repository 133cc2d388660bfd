#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "io/images/png_row_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <array>
#include <cstring>
#include <type_traits>
#include <vector>

#include "core/simd.h"
#include "io/images/png_row_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace felt::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET != HWY_SCALAR  // which has no vectors of eight lanes
constexpr hn::Full128<int16_t> kWords;
constexpr hn::Full64<uint8_t> kHalf;
using Words = hn::Vec<hn::Full128<int16_t>>;

/// The byte predicted from those to the left, above and above left. Ties go to the left, then to above.
HWY_INLINE Words predicted(Words left, Words above, Words corner) {
  const Words up = hn::Sub(above, corner), across = hn::Sub(left, corner);
  const Words to_left = hn::Abs(up), to_above = hn::Abs(across), to_corner = hn::Abs(hn::Add(up, across));
  const Words least = hn::Min(to_left, hn::Min(to_above, to_corner));
  return hn::IfThenElse(hn::Eq(to_left, least), left, hn::IfThenElse(hn::Eq(to_above, least), above, corner));
}

/// N bytes a pixel. A pixel of a row takes `kLanes` lanes; a vector holds a pixel of `kInVector` rows.
template <int N>
struct Wavefront {
  static constexpr int kLanes = N == 2 ? 2 : 4, kInVector = 8 / kLanes, kVectors = kPaethRows / kInVector;
  using Pixel = std::conditional_t<N == 2, uint16_t, uint32_t>;

  static HWY_INLINE Words widened(uint64_t pixels) {
    return hn::PromoteTo(kWords, hn::BitCast(kHalf, hn::Set(hn::Full64<uint64_t>(), pixels)));
  }
  static HWY_INLINE uint64_t pixel_at(const uint8_t* from) {
    Pixel pixel;
    std::memcpy(&pixel, from, sizeof pixel);
    return pixel;
  }

  /// Columns from kPaethRows - 1 on in the first row, from one less in each row below; `row[r]` is row r, shifted by r
  /// pixels to the right.
  static HWY_INLINE void run(const std::array<uint8_t*, kPaethRows>& row, const uint8_t* above, size_t end) {
    constexpr size_t kFirst = (kPaethRows - 1) * N;
    Words out[kVectors], up[kVectors];
    for (int v = 0; v < kVectors; ++v) {
      uint64_t left = 0, corner = 0;
      for (int i = 0; i < kInVector; ++i) {
        const int r = v * kInVector + i;
        if (r == kPaethRows - 1) break;  // at its first pixel: nothing is to the left
        left |= pixel_at(row[size_t(r)] + kFirst - N) << (8 * kLanes * i);
        corner |= pixel_at((r == 0 ? above : row[size_t(r - 1)] - N) + kFirst - N) << (8 * kLanes * i);
      }
      out[v] = widened(left), up[v] = widened(corner);
    }
    const Words low_byte = hn::Set(kWords, 255);
    for (size_t at = kFirst; at < end; at += N) {
      Words carried = widened(pixel_at(above + at));
      for (int v = 0; v < kVectors; ++v) {
        uint64_t filtered = 0;
        for (int i = 0; i < kInVector; ++i)
          filtered |= pixel_at(row[size_t(v * kInVector + i)] + at) << (8 * kLanes * i);
        // What stands above a row's pixel is what came out of the row above one step ago.
        const Words corner = up[v];
        up[v] = hn::Or(hn::ShiftLeftLanes<kLanes>(kWords, out[v]), carried);
        carried = hn::ShiftRightLanes<8 - kLanes>(kWords, out[v]);
        out[v] = hn::And(hn::Add(widened(filtered), predicted(out[v], up[v], corner)), low_byte);
        const uint64_t pixels = hn::GetLane(hn::BitCast(hn::Full64<uint64_t>(), hn::DemoteTo(kHalf, out[v])));
        for (int i = 0; i < kInVector; ++i) {
          const auto pixel = Pixel(pixels >> (8 * kLanes * i));
          std::memcpy(row[size_t(v * kInVector + i)] + at, &pixel, N);
        }
      }
    }
  }
};
#endif

bool has_wavefront(int pixel_bytes) { return HWY_TARGET != HWY_SCALAR && pixel_bytes >= 2 && pixel_bytes <= 4; }

void unfilter_wavefront([[maybe_unused]] const std::array<uint8_t*, kPaethRows>& row,
                        [[maybe_unused]] const uint8_t* above, [[maybe_unused]] size_t end,
                        [[maybe_unused]] int pixel_bytes) {
#if HWY_TARGET != HWY_SCALAR
  if (pixel_bytes == 2) Wavefront<2>::run(row, above, end);
  if (pixel_bytes == 3) Wavefront<3>::run(row, above, end);
  if (pixel_bytes == 4) Wavefront<4>::run(row, above, end);
#endif
}

}  // namespace felt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {

HWY_EXPORT(has_wavefront);
HWY_EXPORT(unfilter_wavefront);

void unfilter_paeth_rows(uint8_t* rows, size_t stride, int count, size_t bytes, int pixel_bytes) {
  const size_t pixel = size_t(pixel_bytes);
  if (simd_scalar_forced() || bytes % pixel != 0 || bytes < 2 * kPaethRows * pixel ||
      !HWY_DYNAMIC_DISPATCH(has_wavefront)(pixel_bytes)) {
    for (int r = 0; r < count; ++r, rows += stride) unfilter_row(4, rows, rows - stride, bytes, pixel_bytes);
    return;
  }

  // Rows that are not there work on a row of nothing.
  thread_local std::vector<uint8_t> nothing;
  if (count < kPaethRows) nothing.resize(stride + kPaethRows * pixel + 8);
  std::array<uint8_t*, kPaethRows> row, shifted;
  for (size_t r = 0; r < kPaethRows; ++r) {
    row[r] = int(r) < count ? rows + r * stride : nothing.data() + kPaethRows * pixel;
    shifted[r] = row[r] - r * pixel;
  }
  // The corners of the front: the first pixels of the upper rows, and the last ones of the lower rows.
  for (size_t r = 0; r + 1 < kPaethRows && int(r) < count; ++r)
    unfilter_row(4, row[r], rows + r * stride - stride, (kPaethRows - 1 - r) * pixel, pixel_bytes);
  HWY_DYNAMIC_DISPATCH(unfilter_wavefront)(shifted, rows - stride, bytes, pixel_bytes);
  for (size_t r = 1; r < size_t(count); ++r)
    unfilter_row(4, row[r], rows + r * stride - stride, bytes, pixel_bytes, bytes - r * pixel);
}

}  // namespace felt
#endif
