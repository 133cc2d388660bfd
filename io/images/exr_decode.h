#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/images/depth_decode.h"
#include "io/images/image_decode.h"

namespace felt {

bool is_exr(std::span<const uint8_t> file);

/// Header of the first part of an OpenEXR file. Throws ImageError.
ImageHeader exr_header(std::span<const uint8_t> file, const std::string& where);

/// The depth channel of the first part, as floats: the only one there is, else the one named Z (or `layer.Z`), Y or R.
/// Scan lines of any compression; throws ImageError, for tiles and deep images too.
Image<float> decode_exr(std::span<const uint8_t> file, const std::string& where);

}  // namespace felt
