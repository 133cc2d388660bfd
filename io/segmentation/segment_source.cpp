#include "io/segmentation/segment_source.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "mapping/store/region_settings.h"

namespace felt {

Image<uint16_t> segments_of(const Frame& frame, SegmentSource source, const FrameSegmentSettings& settings) {
  if (source == SegmentSource::geometric) {
    static thread_local FrameSegmentScratch scratch;  // reused by the threads that read frames
    return frame_segments(frame.depth_m, frame.camera, frame.color, settings, scratch);
  }
  Image<uint16_t> instances = source == SegmentSource::instances ? frame.instances : Image<uint16_t>();
  for (uint16_t& i : instances)
    if (i == kNoLabel) i = 0;  // outside the labelled image
  return instances;
}

ViewMask segment_mask(const Frame& frame, const Eigen::Vector2d& uv, SegmentSource source) {
  const Image<uint16_t> segments = segments_of(frame, source);
  const double u = std::floor(uv.x() + 0.5), v = std::floor(uv.y() + 0.5);
  const auto pixel = [&] { return "pixel (" + std::to_string(int(u)) + ", " + std::to_string(int(v)) + ")"; };
  if (segments.empty()) throw TouchError("region mask: expected a frame with instances or masks, found none");
  if (!(u >= 0 && v >= 0 && u < segments.width() && v < segments.height()))
    throw TouchError("region mask: expected a pixel inside the image, found one outside");
  const uint16_t segment = segments(int(u), int(v));
  if (segment == 0) throw TouchError(describe_mismatch("region mask", pixel(), "a pixel of a segment", "one of none"));
  ViewMask view{Image<uint8_t>(segments.width(), segments.height(), 0), frame.camera, frame.T_world_camera};
  std::transform(segments.begin(), segments.end(), view.mask.begin(),
                 [&](uint16_t s) { return uint8_t(s == segment); });
  return view;
}

}  // namespace felt
