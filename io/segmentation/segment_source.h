#pragma once

#include <optional>

#include "core/frame.h"
#include "mapping/labels/frame_segments.h"
#include "mapping/regions/view_mask.h"

namespace felt {

/// Class-agnostic segments of a frame: none, from its depth and normals, or the instance images that it carries.
enum class SegmentSource { none, geometric, instances };

/// Segments of a frame by their source: numbers from 1, 0 where there is none. Empty where the frame has no instances.
Image<uint16_t> segments_of(const Frame& frame, SegmentSource source, const FrameSegmentSettings& settings = {});

/// The segment under a pixel (u, v) of the image as a mask with the frame's camera. Throws TouchError where the frame
/// has no segments or the pixel lies on none.
ViewMask segment_mask(const Frame& frame, const Eigen::Vector2d& uv, SegmentSource source);

}  // namespace felt
