#pragma once

#include <filesystem>

#include "io/sequence/sequence_listing.h"

namespace felt {

/// Gives each frame the image of `folder` that has the name of its depth or colour image or, failing that, its frame
/// number. Frames without one keep none. Throws IoError where the folder cannot be read and FormatError (it calls the
/// images `what`) where nothing in it belongs to any frame. `folders`: subfolders count as images.
void attach_images(const std::filesystem::path& folder, SequenceListing& listing, ImageSource FrameRecord::*member,
                   const char* what, bool folders = false);

/// The same for label images.
void attach_labels(const std::filesystem::path& folder, SequenceListing& listing);

/// The same for instance images: one 16-bit PNG a frame with a number a thing, 0 for none; or one folder a frame, named
/// like an image, of PNG masks with one thing each, as SAM and FastSAM save them.
void attach_instances(const std::filesystem::path& folder, SequenceListing& listing);

}  // namespace felt
