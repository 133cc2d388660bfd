#pragma once

#include <cstdint>

#include "mapping/block_store.h"
#include "mapping/integration_config.h"

namespace felt {

/// One depth image as the kernels see it: everything a block needs to know, computed once a frame. All lengths in
/// metres.
///
/// A voxel's homogeneous pixel coordinates (hu, hv, z) = K T_camera_world p are linear in its index, so a block needs
/// its first voxel's coordinates only: `plane[c][y * 8 + z]` adds the place within an x-slab and `step_x[c]` the next
/// slab. The half that makes truncation round to the nearest pixel is folded into K.
struct DepthView {
  const float* depth_m = nullptr;  ///< width * height; NaN, infinite and out-of-range values are ignored
  const float* scale = nullptr;  ///< width * height: what (d - z) is multiplied with, or null for 1; 0: pixel unusable
  int width = 0, height = 0;
  double first[3][4] = {};  ///< row c: (hu, hv, z) of world voxel index (i, j, k): first[c] . (i, j, k, 1)
  alignas(64) float plane[3][64] = {};
  float step_x[3] = {};
  float min_depth_m = 0, max_depth_m = 0;
  float truncation_m = 0;
  float dropoff_start_m = 0;  ///< positive: behind the surface
  float dropoff_slope = 0;    ///< 1 / (truncation - dropoff_start)
  WeightModel weight = WeightModel::constant;
  float max_weight = 0;
  bool carve = false;
};

/// Homogeneous pixel coordinates of the block's first voxel: one definition, so that every target starts from the same
/// bits.
inline void block_base(const BlockCoord& block, const DepthView& view, float base[3]) {
  for (int c = 0; c < 3; ++c)
    base[c] = float(view.first[c][0] * (block.x * 8.0) + view.first[c][1] * (block.y * 8.0) +
                    view.first[c][2] * (block.z * 8.0) + view.first[c][3]);
}

/// Kinect noise sigma(d) = floor + growth (d - offset)^2 (Nguyen, Izadi, Lovell 2012), metres.
struct SensorNoise {
  static constexpr float kFloor = 0.0012f, kGrowth = 0.0019f, kOffset = 0.4f;
  static constexpr float kSigmaAtOneMetre = kFloor + kGrowth * ((1 - kOffset) * (1 - kOffset));
};

/// What one frame says about one block: filled by observe_block, read by every channel's fusion.
struct alignas(64) BlockObservation {
  float sdf_m[kBlockVoxels];        ///< truncated; only where valid
  float weight[kBlockVoxels];       ///< only where valid
  int32_t pixel[kBlockVoxels];      ///< v * width + u; some pixel of the image where not valid
  uint8_t valid[kBlockVoxels / 8];  ///< bit z of byte x * 8 + y: the mask layout of an OpenVDB leaf
};

/// Projects the block's voxels into the view. Returns whether any voxel is observed. Lanes that are not valid hold
/// unspecified values. Every target gives the scalar version's bits: only +, -, *, / and comparisons, each rounded
/// once.
bool observe_block(const BlockCoord& block, const DepthView& view, BlockObservation& out) noexcept;
bool observe_block_scalar(const BlockCoord& block, const DepthView& view, BlockObservation& out) noexcept;

/// Weighted running average (Curless and Levoy 1996): tsdf <- (W tsdf + w sdf) / (W + w), W <- min(W + w, max_weight).
void fuse_tsdf(const BlockObservation& observation, float max_weight, GeometryPlanes& planes) noexcept;
void fuse_tsdf_scalar(const BlockObservation& observation, float max_weight, GeometryPlanes& planes) noexcept;

/// Running average of colour over at most kMaxColorCount observations, rounded to 1/256 grey level. Voxels outside
/// |sdf| < band are left alone. `rgba` holds one 32-bit pixel (r in the low byte) per depth pixel;
/// a = 0 in the high byte: no colour was seen there.
inline constexpr int kMaxColorCount = 255;
void fuse_color(const BlockObservation& observation, const uint32_t* rgba, float band_m, ColorPlanes& planes) noexcept;
void fuse_color_scalar(const BlockObservation& observation, const uint32_t* rgba, float band_m,
                       ColorPlanes& planes) noexcept;

/// Depth pixels as they mark blocks: q(u, v, d) = origin + d (ray0 + u ray_u + v ray_v) in units of blocks, relative to
/// a box of cells. A cell is marked where a sample of [d - truncation, d + truncation] falls.
struct AllocationView {
  const float* depth_m = nullptr;
  int width = 0, height = 0;
  int stride = 1;  ///< every stride-th row and column
  float min_depth_m = 0, max_depth_m = 0;
  float origin[3] = {}, ray0[3] = {}, ray_u[3] = {}, ray_v[3] = {};
  int cells[3] = {};                 ///< extent of the box
  const float* offsets_m = nullptr;  ///< samples along the ray, relative to d
  int samples = 0;
};

/// Marks cells (row-major x, y, z; one byte each) seen by image row `v`. Cells may be written by several rows at once:
/// all write the same value.
void mark_cells_in_row(const AllocationView& view, int v, uint8_t* cells) noexcept;
void mark_cells_in_row_scalar(const AllocationView& view, int v, uint8_t* cells) noexcept;

/// scale[v * width + u] = |n . r| of DistanceModel::tangent_plane for row v, from central differences of the depth:
/// with slopes zu, zv per pixel, n is proportional to (-fx zu, -fy zv, z + fx zu rx + fy zv ry) and n . r to z. 0 where
/// a neighbour is missing, or farther off than `max_step` times the depth.
struct SlopeView {
  const float* depth_m = nullptr;
  int width = 0, height = 0;
  float fx = 0, fy = 0, cx = 0, cy = 0;
  float max_depth_m = 0;  ///< farther pixels are not used
  float max_step = 0;
};
void tangent_scale_row(const SlopeView& view, int v, float* scale_row) noexcept;
void tangent_scale_row_scalar(const SlopeView& view, int v, float* scale_row) noexcept;

}  // namespace felt
