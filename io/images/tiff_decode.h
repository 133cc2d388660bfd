#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/images/depth_decode.h"
#include "io/images/image_decode.h"

namespace felt {

bool is_tiff(std::span<const uint8_t> file);

/// Header of the first image of a TIFF. Throws ImageError.
ImageHeader tiff_header(std::span<const uint8_t> file, const std::string& where);

/// The first image of a TIFF: one channel of 16-bit integers, or of floats of 32 or 64 bits, in strips; uncompressed,
/// PackBits, LZW or Deflate. Throws ImageError, for tiles and other compressions too.
StoredDepth decode_tiff(std::span<const uint8_t> file, const std::string& where);

}  // namespace felt
