#include <algorithm>
#include <cmath>

#include "mapping/labels/frame_segment_kernels.h"

namespace felt {
namespace {

template <int kPlanes>
void smooth(const DepthRow& row, std::ptrdiff_t stride, int reach, int u, const float* const* value,
            float (&mean)[kPlanes]) {
  const float *const d = row.depth + u, limit = row.step[u];
  float count = 1;
  for (int plane = 0; plane < kPlanes; ++plane) mean[plane] = value[plane][u];
  for (int k = 1; k <= reach; ++k) {
    const std::ptrdiff_t far = k * stride;
    const bool before = std::fabs(d[-far] - d[0]) < limit, after = std::fabs(d[far] - d[0]) < limit;
    for (int plane = 0; plane < kPlanes; ++plane)
      mean[plane] += (before ? value[plane][u - far] : 0.0f) + (after ? value[plane][u + far] : 0.0f);
    count += (before ? 1.0f : 0.0f) + (after ? 1.0f : 0.0f);
  }
  for (int plane = 0; plane < kPlanes; ++plane) mean[plane] /= count;
}

void normalise(float& x, float& y, float& z) {
  const float scale = 1 / std::sqrt(x * x + y * y + z * z + 1e-20f);
  x *= scale, y *= scale, z *= scale;
}

/// Slope of depth per pixel between pixels `far` elements and `pixels` pixels away, from whichever sides lie within the
/// image and on the same surface.
float slope(const float* depth, std::ptrdiff_t far, int pixels, bool has_back, bool has_ahead, float reach) {
  const float back = has_back ? depth[0] - depth[-far] : 0.0f, ahead = has_ahead ? depth[far] - depth[0] : 0.0f;
  const bool use_back = has_back && std::fabs(back) < reach, use_ahead = has_ahead && std::fabs(ahead) < reach;
  const float sum = (use_back ? back : 0.0f) + (use_ahead ? ahead : 0.0f);
  return sum / (float(pixels) * (use_back && use_ahead ? 2.0f : 1.0f));
}

}  // namespace

void smooth_row_scalar(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end, const float* value,
                       float* mean) noexcept {
  for (int u = first; u < end; ++u) {
    float m[1];
    smooth(row, stride, reach, u, &value, m);
    mean[u] = m[0];
  }
}

void smooth_normal_row_scalar(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end,
                              const float* const value[3], float* const mean[3], bool unit) noexcept {
  for (int u = first; u < end; ++u) {
    float m[3];
    smooth(row, stride, reach, u, value, m);
    if (unit) normalise(m[0], m[1], m[2]);
    for (int plane = 0; plane < 3; ++plane) mean[plane][u] = m[plane];
  }
}

void normal_row_scalar(const NormalView& view, const DepthRow& row, int v, int first, int end,
                       float* const normal[3]) noexcept {
  const int k = view.reach;
  for (int u = first; u < end; ++u) {
    const float* const d = row.depth + u;
    const float su = slope(d, k, k, view.left, view.right, 2 * row.step[u]);
    const float sv = slope(d, std::ptrdiff_t(k) * view.width, k, view.up, view.down, 2 * row.step[u]);
    // Cross product of the two tangents of z(u, v) ray(u, v), divided by z / (fx fy).
    float x = -view.fx * su, y = -view.fy * sv;
    float z = d[0] + (float(u) - view.cx) * su + (float(v) - view.cy) * sv;
    normalise(x, y, z);
    normal[0][u] = x, normal[1][u] = y, normal[2][u] = z;
  }
}

void join_row_scalar(const SurfaceRow& s, int v, std::ptrdiff_t next, int first, int end, uint8_t* joined) noexcept {
  const float *const d = s.row.depth, *const limit = s.row.step;
  const float *const nx = s.normal[0], *const ny = s.normal[1], *const nz = s.normal[2];
  const bool along_row = next == 1;
  const float y0 = (float(v) - s.cy) * s.per_fy, y1 = along_row ? y0 : y0 + s.per_fy;
  for (int u = first; u < end; ++u) {
    const std::ptrdiff_t o = u + next;
    const float x0 = (float(u) - s.cx) * s.per_fx, x1 = along_row ? x0 + s.per_fx : x0;
    const float px = d[o] * x1 - d[u] * x0, py = d[o] * y1 - d[u] * y0, pz = d[o] - d[u];
    const float off = std::fabs(nx[u] * px + ny[u] * py + nz[u] * pz);
    const float off_other = std::fabs(nx[o] * px + ny[o] * py + nz[o] * pz);
    const float tolerance = s.plane_of_step * limit[u];
    joined[u] = uint8_t((std::fabs(pz) < limit[u]) & (off < tolerance) & (off_other < tolerance) & (limit[o] > 0));
  }
}

void part_row_by_normals_scalar(const SurfaceRow& s, std::ptrdiff_t next, int reach, int first, int end,
                                uint8_t* joined) noexcept {
  const float *const d = s.row.depth, *const limit = s.row.step;
  const float *const nx = s.normal[0], *const ny = s.normal[1], *const nz = s.normal[2];
  for (int u = first; u < end; ++u) {
    const std::ptrdiff_t o = u + next, far = reach * next;
    const std::ptrdiff_t a = std::fabs(d[u - far] - d[u]) < 2 * limit[u] ? u - far : u;
    const std::ptrdiff_t b = std::fabs(d[o + far] - d[u]) < 2 * limit[u] ? o + far : o;
    joined[u] &= uint8_t(nx[a] * nx[b] + ny[a] * ny[b] + nz[a] * nz[b] > s.least_cos);
  }
}

void part_row_by_color_scalar(const Rgba8* row, std::ptrdiff_t next, int limit, int first, int end,
                              uint8_t* joined) noexcept {
  for (int u = first; u < end; ++u) {
    int r = 0, g = 0, b = 0;
    for (int k = 0; k < 3; ++k) {
      const Rgba8 &before = row[u - k * next], &after = row[u + (k + 1) * next];
      r += after.r - before.r, g += after.g - before.g, b += after.b - before.b;
    }
    joined[u] &= uint8_t(r * r + g * g + b * b <= limit);
  }
}

}  // namespace felt
