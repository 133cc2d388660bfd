#pragma once

#include "io/sequence/sequence_listing.h"

namespace felt {

/// Leaves the selected frames in the listing. Throws ConfigError where there is none of them.
void select_frames(const FrameSelection& selection, SequenceListing& listing);

}  // namespace felt
