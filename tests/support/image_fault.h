#pragma once

#include <string>

#include "io/images/image_decode.h"

namespace felt::test {

/// Reason of the ImageError that `decode` throws; empty where it accepts.
template <typename Decode>
std::string reason_of(Decode decode) {
  try {
    decode();
  } catch (const ImageError& fault) {
    return fault.reason();
  }
  return {};
}

}  // namespace felt::test
