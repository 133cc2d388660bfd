#pragma once

#include <vector>

#include "io/doctor/finding.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// What the files alone tell, frame by frame over the whole sequence: images and poses that are missing, gaps in the
/// frame numbers, and images that are a copy of the frame before.
std::vector<Finding> check_files(const SequenceListing& listing);

}  // namespace felt
