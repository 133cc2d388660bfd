#include <algorithm>
#include <cmath>
#include <cstring>

#include "mapping/fusion/tsdf_kernels.h"

namespace felt {
namespace {

float sensor_weight(float d) {
  const float off = d - SensorNoise::kOffset;
  const float ratio = SensorNoise::kSigmaAtOneMetre / (SensorNoise::kFloor + SensorNoise::kGrowth * (off * off));
  return ratio * ratio;
}

float observation_weight(const DepthView& view, float d, float sdf) {
  float w = 1;
  if (view.weight == WeightModel::inverse_square) w = 1.0f / (d * d);
  if (view.weight == WeightModel::sensor_noise) w = sensor_weight(d);
  if (sdf < -view.dropoff_start_m) w = w * ((sdf + view.truncation_m) * view.dropoff_slope);
  return w;
}

float ray_length(const DepthView& view, float u, float v) {
  const float x = (u - view.centre[0]) * view.inverse_focal[0], y = (v - view.centre[1]) * view.inverse_focal[1];
  return std::sqrt((1 + x * x) + y * y);
}

}  // namespace

uint64_t cubes_in_band_scalar(const BlockCoord& block, const DepthView& view) noexcept {
  float base[3];
  block_base(block, view, base);
  const DepthTiles::Level* level = tiles_for(view, base[2] + view.nearest_cube_m - view.reach_m);
  if (level == nullptr) return kAllCubes;
  const auto tile = float(level->tile_px), inverse_tile = 1.0f / tile;
  uint64_t cubes = 0;
  for (int cube = 0; cube < 64; ++cube) {
    const float z = base[2] + view.cube[2][cube];
    const float inverse_z = 1.0f / z;
    const float u = (base[0] + view.cube[0][cube]) * inverse_z + tile;
    const float v = (base[1] + view.cube[1][cube]) * inverse_z + tile;
    if (!(u >= 0 && v >= 0 && u < float(view.width) + 2 * tile && v < float(view.height) + 2 * tile)) continue;
    const DepthRange range =
        level->around[size_t(v * inverse_tile) * size_t(level->around_stride()) + size_t(u * inverse_tile)];
    if (range.minus_farthest_m + z < view.band_m && (view.carve || range.nearest_m - z < view.band_m))
      cubes |= uint64_t(1) << cube;
  }
  return cubes;
}

bool observe_block_scalar(const BlockCoord& block, const DepthView& view, BlockObservation& out,
                          uint64_t cubes) noexcept {
  float base[3];
  block_base(block, view, base);
  std::memset(out.valid, 0, sizeof out.valid);
  out.groups = 0;
  const uint32_t looked_at = groups_of_cubes(cubes);
  for (int i = 0; i < kBlockVoxels; ++i) {
    const int x = i >> 6, lane = i & 63;
    out.pixel[i] = 0;
    if ((looked_at >> (i / kGroupVoxels) & 1) == 0) continue;
    const float z = (base[2] + float(x) * view.step_x[2]) + view.plane[2][lane];
    const float inverse_z = 1.0f / z;
    const float u = ((base[0] + float(x) * view.step_x[0]) + view.plane[0][lane]) * inverse_z;
    const float v = ((base[1] + float(x) * view.step_x[1]) + view.plane[1][lane]) * inverse_z;
    if (!(z > 0 && u >= 0 && v >= 0 && u < float(view.width) && v < float(view.height))) continue;
    const int32_t pixel = int32_t(v) * view.width + int32_t(u);
    out.pixel[i] = pixel;
    const float d = view.depth_m[pixel];
    if (!(d >= view.min_depth_m && d <= view.max_depth_m)) continue;
    float sdf = d - z;
    if (view.scale != nullptr) {
      const float scale = view.scale[pixel];
      if (!(scale > 0)) continue;
      sdf = sdf * scale;
    } else if (view.along_ray) {
      sdf = sdf * ray_length(view, u, v);
    }
    if (!(sdf > -view.truncation_m)) continue;
    if (!view.carve && !(sdf < view.truncation_m)) continue;
    out.sdf_m[i] = std::min(sdf, view.truncation_m);
    out.weight[i] = observation_weight(view, d, sdf);
    out.valid[i >> 3] |= uint8_t(1u << (i & 7));
    out.groups |= 1u << (i / kGroupVoxels);
  }
  return out.groups != 0;
}

void fuse_tsdf_scalar(const BlockObservation& observation, float max_weight, GeometryPlanes& planes) noexcept {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if ((observation.valid[i >> 3] >> (i & 7) & 1) == 0) continue;
    const float W = planes.weight[i], w = observation.weight[i], sum = W + w;
    planes.tsdf[i] = (planes.tsdf[i] * W + observation.sdf_m[i] * w) / sum;
    planes.weight[i] = std::min(sum, max_weight);
  }
}

void fuse_color_scalar(const BlockObservation& observation, const uint32_t* rgba, float band_m,
                       ColorPlanes& planes) noexcept {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if ((observation.valid[i >> 3] >> (i & 7) & 1) == 0) continue;
    if (!(std::fabs(observation.sdf_m[i]) < band_m)) continue;
    const uint32_t pixel = rgba[observation.pixel[i]];
    if (pixel >> 24 == 0) continue;
    const int count = std::min<int>(planes.count[i] + 1, kMaxColorCount);
    const float share = 1.0f / float(count);
    const auto average = [&](uint16_t& stored, uint32_t byte) {
      const float old = stored;
      const float fresh = old + (float(byte * 256) - old) * share;
      stored = uint16_t(int32_t(fresh + 0.5f));
    };
    average(planes.r[i], pixel & 0xff);
    average(planes.g[i], pixel >> 8 & 0xff);
    average(planes.b[i], pixel >> 16 & 0xff);
    planes.count[i] = uint16_t(count);
  }
}

void tangent_scale_row_scalar(const SlopeView& view, int v, float* scale_row) noexcept {
  const float* row = view.depth_m + size_t(v) * view.width;
  if (v == 0 || v == view.height - 1 || view.width < 3) {
    std::fill_n(scale_row, view.width, 0.0f);
    return;
  }
  const float ry = (float(v) - view.cy) / view.fy;
  const float half_fx = 0.5f * view.fx, half_fy = 0.5f * view.fy, inverse_fx = 1.0f / view.fx;
  scale_row[0] = scale_row[view.width - 1] = 0;
  for (int u = 1; u < view.width - 1; ++u) {
    const float z = row[u], left = row[u - 1], right = row[u + 1], up = row[u - view.width], down = row[u + view.width];
    const float limit = view.max_step * z;
    // Comparisons with NaN are false, so a missing or invalid neighbour fails here as well.
    const bool smooth = z > 0 && z <= view.max_depth_m && std::fabs(left - z) <= limit &&
                        std::fabs(right - z) <= limit && std::fabs(up - z) <= limit && std::fabs(down - z) <= limit;
    const float su = half_fx * (right - left), sv = half_fy * (down - up);
    const float rx = (float(u) - view.cx) * inverse_fx;
    const float nz = z + su * rx + sv * ry;
    scale_row[u] = smooth ? z / std::sqrt(su * su + sv * sv + nz * nz) : 0.0f;
  }
}

}  // namespace felt
