#include "io/images/png_decode.h"

#include <libdeflate.h>

#include <cstring>
#include <memory>

#include "io/images/image_decode.h"
#include "io/images/png_row_kernels.h"

namespace felt {
namespace {

constexpr size_t kSignatureBytes = 8, kHeaderEnd = 33;  // signature and IHDR chunk
constexpr size_t kInterlaceAt = 28;

ImageError unreadable(const std::string& where, const std::string& expected, const std::string& found) {
  return ImageError("unreadable", describe_mismatch(where, "PNG", expected, found));
}

/// The compressed bytes of all IDAT chunks; `joined` holds them where there are several.
std::span<const uint8_t> image_data(std::span<const uint8_t> png, std::vector<uint8_t>& joined,
                                    const std::string& where) {
  std::span<const uint8_t> data;
  joined.clear();
  for (size_t at = kSignatureBytes;;) {
    if (png.size() < at + 12 || png.size() - at - 12 < big_endian_32(&png[at]))
      throw ImageError("truncated", describe_mismatch(where, "PNG", "an IEND chunk at its end",
                                                      "the end after " + std::to_string(png.size()) + " bytes"));
    const size_t length = big_endian_32(&png[at]);
    const uint8_t* const name = &png[at + 4];
    if (libdeflate_crc32(0, name, length + 4) != big_endian_32(name + 4 + length))
      throw unreadable(where, "chunks with right checksums", "a wrong one at byte " + std::to_string(at));
    if (std::memcmp(name, "IEND", 4) == 0) break;
    if (std::memcmp(name, "IDAT", 4) == 0) {
      const std::span<const uint8_t> chunk(name + 4, length);
      if (data.empty() && joined.empty()) {
        data = chunk;
      } else {
        if (joined.empty()) joined.assign(data.begin(), data.end());
        joined.insert(joined.end(), chunk.begin(), chunk.end());
      }
    }
    at += length + 12;
  }
  return joined.empty() ? data : std::span<const uint8_t>(joined);
}

}  // namespace

void inflate_zlib(std::span<const uint8_t> packed, std::span<uint8_t> out, const std::string& where) {
  thread_local const std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)> inflater(
      libdeflate_alloc_decompressor(), libdeflate_free_decompressor);
  const libdeflate_result result =
      libdeflate_zlib_decompress(inflater.get(), packed.data(), packed.size(), out.data(), out.size(), nullptr);
  const std::string expected = std::to_string(out.size()) + " bytes of pixels";
  if (result == LIBDEFLATE_SHORT_OUTPUT)
    throw ImageError("truncated", describe_mismatch(where, "compressed image", expected, "fewer"));
  if (result != LIBDEFLATE_SUCCESS)
    throw ImageError("unreadable", describe_mismatch(where, "compressed image", expected, "damaged or longer data"));
}

bool has_plain_rows(std::span<const uint8_t> png) { return png.size() >= kHeaderEnd && png[kInterlaceAt] == 0; }

PngRows decode_png_rows(std::span<const uint8_t> png, int height, size_t row_bytes, int pixel_bytes,
                        std::vector<uint8_t>& buffer, const std::string& where) {
  thread_local std::vector<uint8_t> joined;
  const std::span<const uint8_t> packed = image_data(png, joined, where);

  // One row of zeros stands above the first, a byte that is read behind the last.
  const size_t stride = row_bytes + 1;
  buffer.resize(stride * (size_t(height) + 1) + 1);
  std::memset(buffer.data(), 0, stride);
  uint8_t* const rows = buffer.data() + stride;
  inflate_zlib(packed, {rows, stride * size_t(height)}, where);

  for (size_t v = 0; v < size_t(height); ++v) {
    uint8_t* const row = rows + v * stride;
    if (row[0] > 4)
      throw unreadable(where, "row filters 0 to 4", std::to_string(row[0]) + " in row " + std::to_string(v));
    int paeth = 0;
    while (paeth < kPaethRows && v + size_t(paeth) < size_t(height) && row[size_t(paeth) * stride] == 4) ++paeth;
    if (paeth > 1)
      unfilter_paeth_rows(row + 1, stride, paeth, row_bytes, pixel_bytes), v += size_t(paeth) - 1;
    else if (row[0] != 0)
      unfilter_row(row[0], row + 1, row - stride + 1, row_bytes, pixel_bytes);
  }
  return {rows + 1, stride};
}

}  // namespace felt
