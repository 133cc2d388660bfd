#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>

#include "mapping/tsdf_kernels.h"

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

}  // namespace

bool observe_block_scalar(const BlockCoord& block, const DepthView& view, BlockObservation& out) noexcept {
  float base[3];
  block_base(block, view, base);
  bool any = false;
  for (int x = 0; x < 8; ++x) {
    const float hu0 = base[0] + float(x) * view.step_x[0];
    const float hv0 = base[1] + float(x) * view.step_x[1];
    const float z0 = base[2] + float(x) * view.step_x[2];
    for (int y = 0; y < 8; ++y) {
      uint8_t bits = 0;
      for (int zi = 0; zi < 8; ++zi) {
        const int lane = y * 8 + zi, i = x * 64 + lane;
        out.pixel[i] = 0;
        const float z = z0 + view.plane[2][lane];
        const float inverse_z = 1.0f / z;
        const float u = (hu0 + view.plane[0][lane]) * inverse_z;
        const float v = (hv0 + view.plane[1][lane]) * inverse_z;
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
        }
        if (!(sdf > -view.truncation_m)) continue;
        if (!view.carve && !(sdf < view.truncation_m)) continue;
        out.sdf_m[i] = std::min(sdf, view.truncation_m);
        out.weight[i] = observation_weight(view, d, sdf);
        bits |= uint8_t(1u << zi);
      }
      out.valid[x * 8 + y] = bits;
      any |= bits != 0;
    }
  }
  return any;
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

void mark_cells_in_row_scalar(const AllocationView& view, int v, uint8_t* cells) noexcept {
  const float* row = view.depth_m + size_t(v) * view.width;
  for (int u = 0; u < view.width; u += view.stride) {
    const float d = row[u];
    if (!(d >= view.min_depth_m && d <= view.max_depth_m)) continue;
    for (int s = 0; s < view.samples; ++s) {
      const float along = d + view.offsets_m[s];
      int32_t cell[3];
      bool inside = true;
      for (int c = 0; c < 3; ++c) {
        const float direction = view.ray0[c] + float(v) * view.ray_v[c] + float(u) * view.ray_u[c];
        const float q = view.origin[c] + along * direction;
        inside = inside && q >= 0 && q < float(view.cells[c]);
        cell[c] = inside ? int32_t(q) : 0;
      }
      if (!inside) continue;
      uint8_t& mark = cells[(size_t(cell[0]) * view.cells[1] + cell[1]) * view.cells[2] + cell[2]];
      std::atomic_ref<uint8_t>(mark).store(1, std::memory_order_relaxed);
    }
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
