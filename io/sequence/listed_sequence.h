#pragma once

#include <memory>

#include "io/sequence/reader.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// The one reader behind every layout: decodes the frames of a listing.
///
/// A frame is skipped, with one of these reasons, where it cannot be fused: "<missing | truncated | unreadable |
/// unknown format | wrong type | too large | wrong-size> <depth | colour | label | probability | instance | mask>
/// image", "too many masks", "depth all zero", "missing pose", "unreadable pose", "non-finite pose", "non-rigid pose",
/// "stamp out of order".
///
/// Throws FormatError where no depth image tells its size or the camera cannot be that of the images, ConfigError where
/// the selection holds no frame.
std::unique_ptr<SequenceReader> make_listed_sequence(const std::filesystem::path& path, const SequenceOptions& options,
                                                     SequenceListing listing);

}  // namespace felt
