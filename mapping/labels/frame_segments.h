#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/camera.h"
#include "core/image.h"

namespace felt {

/// When two neighbouring pixels of a depth image lie on one smooth surface.
struct FrameSegmentSettings {
  /// Largest angle between their normals, taken three pixels further out (of 640 across).
  double normal_change_deg = 10;
  double plane_distance_m = 0.004;  ///< largest distance of a point to the other's tangent plane
  double depth_step_m = 0.02;       ///< largest difference of depth
  double noise_free_m = 1.5;        ///< beyond this depth both distances grow with the square of depth
  /// Largest difference of colour (Euclidean, grey levels) between the means of three pixels on either side; 0: colour
  /// does not matter.
  double color_step = 25;
  int min_pixels = 200;  ///< smaller pieces go to the segment around them
};

/// Working memory of `frame_segments`, reused from frame to frame: fresh memory costs more than the work.
struct FrameSegmentScratch {
  std::vector<float> depth, smooth, step, normal[3], spare, spare_normal[3];
  std::vector<uint32_t> run, parent, size;     ///< first pixels of runs joined along a row, their union-find; pieces
  std::vector<uint32_t> piece, open;           ///< piece of each pixel; pixels of none
  std::vector<uint32_t> wave, next;            ///< pixels that grow into them
  std::vector<uint8_t> join_right, join_down;  ///< of one row
};

/// Segments of a depth image that know of no classes: pieces of smooth surface, numbered from 1 in the order of their
/// first pixel; 0 where nothing was measured. Neighbours are joined (union-find) where depth, normals of a smoothed
/// depth and distance to each other's tangent plane agree, so a segment ends at steps and creases; pieces too small to
/// be a segment then join the nearest on their own side of every depth step. `color`: empty, or of the depth image's
/// size. At most 65535 segments: later ones are 0.
Image<uint16_t> frame_segments(const DepthImage& depth_m, const PinholeCamera& camera, const ColorImage& color,
                               const FrameSegmentSettings& settings, FrameSegmentScratch& scratch);
/// The same with working memory of its own.
Image<uint16_t> frame_segments(const DepthImage& depth_m, const PinholeCamera& camera, const ColorImage& color = {},
                               const FrameSegmentSettings& settings = {});

}  // namespace felt
