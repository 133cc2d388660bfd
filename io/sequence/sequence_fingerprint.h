#pragma once

#include <map>
#include <string>

#include "core/camera.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

// Both name a recording by what it is and not by where it lies (XXH3, 32 hexadecimal digits): equal for copies of it,
// whatever frames are selected and however depth is understood. Nothing is decoded.

/// Which recording it is, by its first eight frames, so that it keeps its name while it grows. 16 digits for the images
/// (sizes of depth and colour, bytes of the first depth image), then 16 for where they were taken (frame numbers,
/// stamps and the poses that the listing holds): the same images with other poses agree in the first half only.
std::string fingerprint(const SequenceListing& listing);

/// The same of all frames: another one as soon as any frame came, went or changed.
std::string frames_content(const SequenceListing& listing);

/// SequenceInfo::reading. Label, probability and instance images go by their sizes and the bytes of the first of them.
std::map<std::string, std::string> reading_text(const SequenceListing& listing, const PinholeCamera& camera);

}  // namespace felt
