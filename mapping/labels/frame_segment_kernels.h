#pragma once

#include <cstddef>
#include <cstdint>

#include "core/image.h"

namespace felt {

// Runs of pixels [first, end) of image rows, as geometric segments are cut from depth
// (mapping/labels/frame_segments.h). Every target gives the scalar version's bits. All pointers are to the beginning of
// a row; rows of all planes are equally far apart. What lies `reach` or `next` elements off a pixel of the run must lie
// within the image.

/// Depth of a row, 0 where none was measured, and the largest difference to a neighbour on the same surface, -1 there.
struct DepthRow {
  const float* depth;
  const float* step;
};

/// Mean over the pixel and those up to `reach` steps of `stride` elements to either side whose depth is within the
/// pixel's step of its own. With the same weights for three planes, whose means are then scaled to length 1 where
/// `unit` is set.
void smooth_row(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end, const float* value,
                float* mean) noexcept;
void smooth_row_scalar(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end, const float* value,
                       float* mean) noexcept;
void smooth_normal_row(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end,
                       const float* const value[3], float* const mean[3], bool unit) noexcept;
void smooth_normal_row_scalar(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end,
                              const float* const value[3], float* const mean[3], bool unit) noexcept;

/// How slopes of depth become normals: focal lengths and principal point in pixels, slopes over `reach` pixels on the
/// sides that the image has.
struct NormalView {
  float fx, fy, cx, cy;
  int width, reach;
  bool left, right, up, down;
};

/// Unit normals of image row `v` of a smoothed depth, pointing away from the camera.
void normal_row(const NormalView& view, const DepthRow& row, int v, int first, int end,
                float* const normal[3]) noexcept;
void normal_row_scalar(const NormalView& view, const DepthRow& row, int v, int first, int end,
                       float* const normal[3]) noexcept;

/// Surface that neighbouring pixels may share: smoothed depth and normals of a row, and what they may differ by.
struct SurfaceRow {
  DepthRow row;
  const float* normal[3];
  float per_fx, per_fy, cx, cy;    ///< of the camera: 1 / pixels, pixels
  float least_cos, plane_of_step;  ///< of normals; distance to the tangent plane as a share of the step
};

/// joined[u] = whether pixels u and u + `next` of image row `v` lie within a step of depth and on each other's tangent
/// plane.
void join_row(const SurfaceRow& surface, int v, std::ptrdiff_t next, int first, int end, uint8_t* joined) noexcept;
void join_row_scalar(const SurfaceRow& surface, int v, std::ptrdiff_t next, int first, int end,
                     uint8_t* joined) noexcept;

/// Clears joined[u] where the normals `reach` steps before u and beyond u + `next` differ: as long as they lie on the
/// pair's surface, for smoothing spreads a crease over several pixels, so that neighbours alone always agree.
void part_row_by_normals(const SurfaceRow& surface, std::ptrdiff_t next, int reach, int first, int end,
                         uint8_t* joined) noexcept;
void part_row_by_normals_scalar(const SurfaceRow& surface, std::ptrdiff_t next, int reach, int first, int end,
                                uint8_t* joined) noexcept;

/// Clears joined[u] where the sums of three colours up to u and from u + `next` are further than the square root of
/// `limit` from each other.
void part_row_by_color(const Rgba8* row, std::ptrdiff_t next, int limit, int first, int end, uint8_t* joined) noexcept;
void part_row_by_color_scalar(const Rgba8* row, std::ptrdiff_t next, int limit, int first, int end,
                              uint8_t* joined) noexcept;

}  // namespace felt
