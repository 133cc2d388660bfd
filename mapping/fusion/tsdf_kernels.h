#pragma once

#include <cstdint>

#include "mapping/fusion/depth_tiles.h"
#include "mapping/fusion/integration_config.h"
#include "mapping/store/block_store.h"

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
  /// (d - z) is multiplied with |r|, r = (x/z, y/z, 1) of the voxel's own centre; not together with `scale`.
  bool along_ray = false;
  int width = 0, height = 0;
  double first[3][4] = {};  ///< row c: (hu, hv, z) of world voxel index (i, j, k): first[c] . (i, j, k, 1)
  alignas(64) float plane[3][64] = {};
  float step_x[3] = {};
  float centre[2] = {}, inverse_focal[2] = {};  ///< r of a pixel (u, v) as projected: ((u, v) - centre) * inverse_focal
  float min_depth_m = 0, max_depth_m = 0;
  float truncation_m = 0;
  float dropoff_start_m = 0;  ///< positive: behind the surface
  float dropoff_slope = 0;    ///< 1 / (truncation - dropoff_start)
  WeightModel weight = WeightModel::constant;
  float max_weight = 0;
  bool carve = false;

  // What `cubes_in_band` needs. A cube is 2^3 voxels; cube (x, y, z) of a block has the number x << 4 | y << 2 | z.
  const DepthTiles* tiles = nullptr;   ///< null: every cube may be observed
  alignas(64) float cube[3][64] = {};  ///< homogeneous pixel coordinates of cube centres, added to the first voxel's
  float nearest_cube_m = 0;            ///< least of cube[2]
  float reach_m = 0;                   ///< a cube's voxels lie within this of its centre along the optical axis,
  float reach_px_m = 0;                ///< and within reach_px_m / (z - reach_m) pixels of it in the image
  float band_m = 0;                    ///< truncation and reach_m, and what rounding may add
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

/// The voxels of a block that are handled together: 16 in a row of memory, (x, y, *) and (x, y + 1, *) with y even.
inline constexpr int kGroupVoxels = 16;

/// What one frame says about one block: filled by observe_block, read by every channel's fusion.
struct alignas(64) BlockObservation {
  float sdf_m[kBlockVoxels];        ///< truncated; only where valid
  float weight[kBlockVoxels];       ///< only where valid
  int32_t pixel[kBlockVoxels];      ///< v * width + u; some pixel of the image where not valid
  uint8_t valid[kBlockVoxels / 8];  ///< bit z of byte x * 8 + y: the mask layout of an OpenVDB leaf
  uint32_t groups;                  ///< bit g: some voxel of [16 g, 16 g + 16) is valid
};

inline constexpr uint64_t kAllCubes = ~uint64_t(0);

/// Which cubes of the block the view may observe: where depth near a cube's place in the image comes close enough to
/// its depth. A bit that is not set promises that `observe_block` finds no valid voxel there.
uint64_t cubes_in_band(const BlockCoord& block, const DepthView& view) noexcept;
uint64_t cubes_in_band_scalar(const BlockCoord& block, const DepthView& view) noexcept;

/// Projects the block's voxels into the view. Returns whether any voxel is observed. Lanes that are not valid hold
/// unspecified values. `cubes` from `cubes_in_band` saves looking at the others and changes nothing. Every target gives
/// the scalar version's bits: only +, -, *, /, sqrt and comparisons, each rounded once.
bool observe_block(const BlockCoord& block, const DepthView& view, BlockObservation& out,
                   uint64_t cubes = kAllCubes) noexcept;
bool observe_block_scalar(const BlockCoord& block, const DepthView& view, BlockObservation& out,
                          uint64_t cubes = kAllCubes) noexcept;

/// The groups with a voxel of one of these cubes.
inline uint32_t groups_of_cubes(uint64_t cubes) {
  uint32_t groups = 0;
  for (int x = 0; x < 8; x += 2) {  // a slice of 4 x 4 cubes holds two slices of four groups
    uint32_t slice = uint32_t(cubes >> (8 * x)) & 0xffff;
    slice |= slice >> 1, slice |= slice >> 2;
    const uint32_t rows = (slice & 0x1111) * 0x1248 >> 12 & 0xf;  // bits 0, 4, 8, 12 side by side
    groups |= (rows | rows << 4) << (4 * x);
  }
  return groups;
}

/// The level of `view.tiles` whose tiles are as large as the reach of a cube at depth `nearest_m` in the image, or null
/// where none is, or the block reaches the camera.
inline const DepthTiles::Level* tiles_for(const DepthView& view, float nearest_m) {
  if (view.tiles == nullptr || !(nearest_m > 0)) return nullptr;
  for (const DepthTiles::Level& level : view.tiles->levels)
    if ((float(level.tile_px) - 0.5f) * nearest_m >= view.reach_px_m) return &level;
  return nullptr;
}

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
