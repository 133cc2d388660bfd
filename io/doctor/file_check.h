#pragma once

#include "io/doctor/finding.h"
#include "io/sequence/reader.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// Images and poses that are missing and gaps in the frame numbers, over the whole sequence, from the listing alone.
Finding check_frames(const SequenceListing& listing);

/// Images whose files are a copy of those of the frame before. `depth` reads the frames of the listing: views of
/// nothing, or of plain surfaces without noise, are alike and do not count.
Finding check_copies(const SequenceListing& listing, const SequenceReader& depth);

}  // namespace felt
