#pragma once

#include <filesystem>

#include "io/sequence_listing.h"

namespace felt {

/// Gives each frame the label image of `folder` that has the name of its depth or colour image or, failing that, its
/// frame number. Frames without one stay unlabelled. Throws IoError where the folder cannot be read and FormatError
/// where nothing in it belongs to any frame.
void attach_labels(const std::filesystem::path& folder, SequenceListing& listing);

/// The same for top-m probability images. One is a 16-bit PNG, as wide as the depth image and 2 m times as high: m
/// planes of class ids, the most probable first, over m planes of their probabilities times 65535.
void attach_probabilities(const std::filesystem::path& folder, SequenceListing& listing);

/// The same for instance images: one 16-bit PNG a frame with a number a thing, 0 for none; or one folder a frame, named
/// like an image, of PNG masks with one thing each, as SAM and FastSAM save them.
void attach_instances(const std::filesystem::path& folder, SequenceListing& listing);

}  // namespace felt
