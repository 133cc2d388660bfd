#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/error.h"
#include "core/image.h"

namespace felt {

/// An image that cannot be used. `reason` is short and countable ("truncated", "too large", "wrong type", "unreadable",
/// "unknown format"); the message names the file and what was found.
class ImageError : public FormatError {
public:
  ImageError(std::string reason, const std::string& message) : FormatError(message), reason_(std::move(reason)) {}
  const std::string& reason() const { return reason_; }

private:
  std::string reason_;
};

/// Largest image that is decoded: a header is believed only up to here, so that a few hostile bytes cannot make us
/// allocate gigabytes. 2^26 pixels are 8192 x 8192.
inline constexpr int64_t kMaxImagePixels = int64_t(1) << 26;

enum class ImageFormat { png, jpeg, tiff, exr, npy };

struct ImageHeader {
  ImageFormat format = ImageFormat::png;
  int width = 0, height = 0;  ///< pixels
  int channels = 0;           ///< as stored; a palette counts as one
  int bits = 0;               ///< per channel
  bool floating = false;      ///< values are floating-point numbers
};

/// Reads format and size from the first bytes of a file (for JPEG the frame header has to be among them).
/// Throws ImageError for an unknown format, a damaged header or a size above kMaxImagePixels.
ImageHeader read_image_header(std::span<const uint8_t> file, const std::string& where);

/// Raw values of a one-channel image, depth or labels: a grey PNG of up to 16 bits, or the indices of a palette PNG.
/// Throws ImageError.
Image<uint16_t> decode_gray16(std::span<const uint8_t> file, const std::string& where);

/// Depth of a .sens container: width x height little-endian 16-bit values, behind a zlib stream where `compressed`.
/// Throws ImageError ("truncated").
Image<uint16_t> decode_u16_values(std::span<const uint8_t> bytes, bool compressed, int width, int height,
                                  const std::string& where);

/// Colour from JPEG or PNG; grey is spread over the channels, 16 bits are cut to 8, alpha is dropped (255).
/// Throws ImageError.
ColorImage decode_color(std::span<const uint8_t> file, const std::string& where);

}  // namespace felt
