#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "io/doctor/finding.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// How depth images hold their values, from the share of neighbouring pixels that differ by more than a quarter:
/// surfaces are smooth, and bits in another order or rows of another length are not. Where another encoding or size is
/// better, `listing` is changed to it, so that what is examined next is sound.
std::vector<Finding> check_depth_images(const std::filesystem::path& path, const SequenceOptions& options,
                                        SequenceListing& listing);

/// Whether the size and camera that the sequence states can be those of its depth images, from the header of the first
/// of them. Where they cannot, `listing` is changed so that it can be opened. Nothing where they can.
std::optional<Finding> check_stated_camera(SequenceListing& listing);

}  // namespace felt
