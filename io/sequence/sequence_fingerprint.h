#pragma once

#include <string>

#include "io/sequence/sequence_listing.h"

namespace felt {

/// Names a recording by what it is and not by where it lies (XXH3, 128 bits, hex): frame numbers, stamps, poses that
/// the listing holds, the sizes of its depth and colour images, and the bytes of the first depth image. Nothing is
/// decoded. Equal for copies of a recording, whatever frames of it are selected and however its depth is understood.
std::string fingerprint(const SequenceListing& listing);

}  // namespace felt
