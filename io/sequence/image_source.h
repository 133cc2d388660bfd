#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "io/images/image_decode.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// Thrown while a frame is read: it becomes a SkippedFrame.
struct SkipFrame {
  std::string reason, detail;
};

/// The bytes of an image of a recording. `kind` is that of the image in reasons: "depth", "colour". Throws SkipFrame.
std::string read_source(const ImageSource& source, const std::string& kind);

inline std::span<const uint8_t> as_bytes(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

/// Runs a decoder (bytes, where) on an image of a recording and turns its complaint into a SkipFrame.
template <typename Decode>
auto decoded(const ImageSource& source, const std::string& kind, Decode decode) {
  const std::string bytes = read_source(source, kind);
  try {
    return decode(as_bytes(bytes), source.path.string());
  } catch (const ImageError& fault) {
    throw SkipFrame{fault.reason() + " " + kind + " image", fault.what()};
  }
}

}  // namespace felt
