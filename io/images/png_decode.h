#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace felt {

/// Unfiltered rows of a PNG: row v begins at `data[v * stride]`, values of 16 bits are big-endian.
struct PngRows {
  const uint8_t* data = nullptr;
  size_t stride = 0;
};

/// The number in the four bytes at `p`, as PNG writes its own.
inline uint32_t big_endian_32(const uint8_t* p) { return uint32_t(p[0]) << 24 | p[1] << 16 | p[2] << 8 | p[3]; }

/// Inflates a zlib stream that holds exactly as many bytes as `out` takes. Throws ImageError ("truncated" where it
/// holds fewer, "unreadable" where it is damaged or longer).
void inflate_zlib(std::span<const uint8_t> packed, std::span<uint8_t> out, const std::string& where);

/// True where `decode_png_rows` can decode the file: a PNG that is not interlaced.
bool has_plain_rows(std::span<const uint8_t> png);

/// Inflates and unfilters a PNG of `height` rows of `row_bytes`, `pixel_bytes` (at least 1) to the pixel, into
/// `buffer`, which the result points into. Much faster than libpng: libdeflate inflates and checks the sums. Throws
/// ImageError ("truncated", "unreadable").
PngRows decode_png_rows(std::span<const uint8_t> png, int height, size_t row_bytes, int pixel_bytes,
                        std::vector<uint8_t>& buffer, const std::string& where);

}  // namespace felt
