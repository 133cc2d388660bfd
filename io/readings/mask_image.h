#pragma once

#include <filesystem>
#include <vector>

#include "mapping/regions/view_mask.h"

namespace felt {

/// An image file as a region mask (non-zero in any channel belongs to it), with `intrinsics` fx, fy, cx, cy and, to
/// be checked against the image, width and height, and `pose` camera to world, 16 numbers row by row. Throws IoError;
/// FormatError where it is no image, has another size than its camera, or the camera cannot have taken it; ConfigError
/// where the pose is none.
ViewMask read_view_mask(const std::filesystem::path& file, const std::vector<double>& intrinsics,
                        const std::vector<double>& pose);

}  // namespace felt
