#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/images/depth_decode.h"
#include "io/images/image_decode.h"

namespace felt {

bool is_npy(std::span<const uint8_t> file);

/// Header of an array as NumPy's `save` writes it, versions 1 to 3: two dimensions (height, width), or three of which
/// the first or the last is 1. Throws ImageError where it is damaged ("unreadable", "truncated") or of another shape or
/// kind than depth has ("wrong type").
ImageHeader npy_header(std::span<const uint8_t> file, const std::string& where);

/// Values in C or Fortran order and either byte order: integers of up to 16 bits as counts (negative ones as 0), wider
/// ones too (those that do not fit as 0), float32 and float64 as numbers. Throws ImageError.
StoredDepth decode_npy(std::span<const uint8_t> file, const std::string& where);

}  // namespace felt
