#pragma once

#include <cstddef>

#include "core/image.h"
#include "io/sequence/reader.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// Up to `count` frames spread over the sequence, in rows of `columns`: colour above depth (near is bright, missing is
/// black), each `width` pixels wide. Frames that cannot be read stay dark red.
ColorImage thumbnail_sheet(const SequenceReader& reader, int count = 12, int columns = 6, int width = 200);

/// The camera's way seen along the direction in which it spreads least: dark line from green (first) to red (last), a
/// short stroke in each viewing direction, a grid of whole metres (or tenfold steps, so that there are at most 40).
/// Throws FormatError where the listing has no usable pose.
ColorImage trajectory_picture(const SequenceListing& listing, int width = 800, int height = 800);

}  // namespace felt
