#pragma once

#include <filesystem>

#include "core/camera.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// The camera of a recording's depth images: the intrinsics of its listing, at the size that most of its first images
/// have that can be read, or at the size that the camera states where one of them has that. `path` is the recording's.
/// Throws FormatError where no depth image tells its size, or it is not the one that the camera states, or the
/// intrinsics cannot be those of such images.
PinholeCamera find_depth_camera(const SequenceListing& listing, const std::filesystem::path& path);

}  // namespace felt
