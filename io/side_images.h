#pragma once

#include <filesystem>

#include "io/sequence_listing.h"

namespace felt {

/// Gives each frame the image of `folder` that has the name of its depth or colour image or, failing that, its frame
/// number. Frames without one keep none. Throws IoError where the folder cannot be read and FormatError (it calls the
/// images `what`) where nothing in it belongs to any frame.
void attach_images(const std::filesystem::path& folder, SequenceListing& listing, ImageSource FrameRecord::*member,
                   const char* what);

/// The same for label images.
void attach_labels(const std::filesystem::path& folder, SequenceListing& listing);

}  // namespace felt
