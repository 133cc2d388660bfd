#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/image.h"

namespace felt {

/// PNG bytes of an image: one channel of 16 or 8 bits, or RGB, with alpha where some pixel has no colour (a = 0).
std::vector<uint8_t> encode_png(const Image<uint16_t>& image);
std::vector<uint8_t> encode_png(const Image<uint8_t>& image);
std::vector<uint8_t> encode_png(const ColorImage& image);

/// JPEG bytes, quality from 1 to 100.
std::vector<uint8_t> encode_jpeg(const ColorImage& image, int quality = 92);

/// Writes bytes to a file. Throws IoError where that fails, a full disk included.
void write_bytes(const std::filesystem::path& path, const std::vector<uint8_t>& bytes);

}  // namespace felt
