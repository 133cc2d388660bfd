#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "core/image.h"

namespace felt {

/// Depth as a file holds it: counts of 16 bits, of which a layout says how many are a metre, or floating-point numbers,
/// which are metres unless somebody says otherwise.
using StoredDepth = std::variant<Image<uint16_t>, Image<float>>;

/// Depth from a grey PNG of up to 16 bits, a TIFF (16 bits or floating point), an EXR or an NPY array. Throws
/// ImageError (io/images/image_decode.h).
StoredDepth decode_depth(std::span<const uint8_t> file, const std::string& where);

}  // namespace felt
