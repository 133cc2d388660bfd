#pragma once

#include <cstddef>
#include <cstdint>

#include "core/image.h"

namespace felt {

/// 16-bit image of metres at `depth_scale` units per metre; 0 where there is no depth or it does not fit. 65535 is none
/// either: some layouts mark missing depth by it. `out_of_range` is raised by the pixels that have depth and do not
/// fit.
Image<uint16_t> stored_depth(const DepthImage& depth_m, double depth_scale, int64_t& out_of_range);

}  // namespace felt
