#include "mapping/frame_segments.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace felt {
namespace {

/// Size of the images and the depth that decides what belongs together.
struct Grid {
  int w, h;
  int smoothing;       ///< pixels on either side that depth and normals are averaged over
  int difference;      ///< pixels on either side that slopes of depth and changes of normals are taken over
  const float* depth;  ///< 0: not measured
  const float* step;   ///< largest difference to a neighbour on the same surface; -1 where nothing was measured
};

void prepare(const DepthImage& depth_m, const FrameSegmentSettings& s, FrameSegmentScratch& scratch) {
  const float base = float(s.depth_step_m), scale = float(1 / (s.noise_free_m * s.noise_free_m));
  scratch.depth.resize(depth_m.size());
  scratch.step.resize(depth_m.size());
  for (size_t p = 0; p < depth_m.size(); ++p) {
    const float d = depth_m.data()[p];
    const bool measured = d > 0 && d < 1e6f;
    scratch.depth[p] = measured ? d : 0.0f;
    scratch.step[p] = measured ? base * std::max(1.0f, d * d * scale) : -1.0f;
  }
}

/// Mean of `value` over the pixels up to `smoothing` to either side whose depth is within the pixel's step of its own,
/// along rows (`stride` 1) or columns (`stride` w).
void smooth_along(const Grid& grid, const float* value, std::ptrdiff_t stride, float* out) {
  const bool rows = stride == 1;
  const int reach = grid.smoothing, u0 = rows ? reach : 0, u1 = rows ? grid.w - reach : grid.w;
  for (int v = 0; v < grid.h; ++v) {
    const size_t row = size_t(v) * size_t(grid.w);
    const float *const x = value + row, *const d = grid.depth + row, *const limit = grid.step + row;
    float* const mean = out + row;
    if (rows ? grid.w <= 2 * reach : v < reach || v >= grid.h - reach) {
      std::copy_n(x, grid.w, mean);
      continue;
    }
    std::copy_n(x, u0, mean);
    for (int u = u0; u < u1; ++u) {
      float sum = x[u], count = 1;
      for (int k = 1; k <= reach; ++k) {
        const std::ptrdiff_t a = u - k * stride, b = u + k * stride;
        const float wa = std::fabs(d[a] - d[u]) < limit[u] ? 1.0f : 0.0f;
        const float wb = std::fabs(d[b] - d[u]) < limit[u] ? 1.0f : 0.0f;
        sum += wa * x[a] + wb * x[b];
        count += wa + wb;
      }
      mean[u] = sum / count;
    }
    if (rows) std::copy(x + u1, x + grid.w, mean + u1);
  }
}

/// Slope of depth per pixel between pixels `far` elements and `pixels` pixels away, from whichever sides lie within the
/// image and on the same surface.
float slope(const float* depth, std::ptrdiff_t far, int pixels, bool has_back, bool has_ahead, float reach) {
  const float back = has_back ? depth[0] - depth[-far] : 0.0f, ahead = has_ahead ? depth[far] - depth[0] : 0.0f;
  const float wb = has_back && std::fabs(back) < reach ? 1.0f : 0.0f;
  const float wa = has_ahead && std::fabs(ahead) < reach ? 1.0f : 0.0f;
  return (wb * back + wa * ahead) / (float(pixels) * std::max(1.0f, wa + wb));
}

void normalise(float& x, float& y, float& z) {
  const float scale = 1 / std::sqrt(x * x + y * y + z * z + 1e-20f);
  x *= scale, y *= scale, z *= scale;
}

/// Unit normals of the smoothed depth, themselves smoothed, pointing away from the camera.
void find_normals(const Grid& grid, const PinholeCamera& camera, FrameSegmentScratch& scratch) {
  const float fx = float(camera.fx), fy = float(camera.fy), cx = float(camera.cx), cy = float(camera.cy);
  const int w = grid.w, k = grid.difference;
  for (auto& plane : scratch.normal) plane.resize(scratch.depth.size());
  const auto row_of_normals = [&](int v, bool up, bool down, bool left, bool right, int u0, int u1) {
    const size_t row = size_t(v) * size_t(w);
    const float *const d = scratch.smooth.data() + row, *const limit = grid.step + row;
    float *const x = scratch.normal[0].data() + row, *const y = scratch.normal[1].data() + row,
                 *const z = scratch.normal[2].data() + row;
    for (int u = u0; u < u1; ++u) {
      const float su = slope(d + u, k, k, left, right, 2 * limit[u]);
      const float sv = slope(d + u, std::ptrdiff_t(k) * w, k, up, down, 2 * limit[u]);
      // Cross product of the two tangents of z(u, v) ray(u, v), divided by z / (fx fy).
      x[u] = -fx * su, y[u] = -fy * sv;
      z[u] = d[u] + (float(u) - cx) * su + (float(v) - cy) * sv;
      normalise(x[u], y[u], z[u]);
    }
  };
  for (int v = 0; v < grid.h; ++v) {
    const bool up = v >= k, down = v + k < grid.h;
    const int left = std::min(k, w), right = std::max(left, w - k);
    for (int u = 0; u < left; ++u) row_of_normals(v, up, down, false, u + k < w, u, u + 1);
    if (up && down)
      row_of_normals(v, true, true, true, true, left, right);
    else
      row_of_normals(v, up, down, true, true, left, right);
    for (int u = right; u < w; ++u) row_of_normals(v, up, down, u >= k, false, u, u + 1);
  }
  for (auto& plane : scratch.normal) {
    smooth_along(grid, plane.data(), 1, scratch.spare.data());
    smooth_along(grid, scratch.spare.data(), w, plane.data());
  }
  for (size_t p = 0; p < scratch.depth.size(); ++p)
    normalise(scratch.normal[0][p], scratch.normal[1][p], scratch.normal[2][p]);
}

/// Decides for one row which pixels are joined to the next along the row, or to the one below.
class Joiner {
public:
  Joiner(const Grid& grid, const PinholeCamera& camera, const FrameSegmentSettings& s, const FrameSegmentScratch& t)
      : grid_(grid),
        smooth_(t.smooth.data()),
        normal_{t.normal[0].data(), t.normal[1].data(), t.normal[2].data()},
        least_cos_(float(std::cos(s.normal_change_deg * std::numbers::pi / 180))),
        plane_of_step_(float(s.plane_distance_m / s.depth_step_m)),
        fx_(float(1 / camera.fx)),
        fy_(float(1 / camera.fy)),
        cx_(float(camera.cx)),
        cy_(float(camera.cy)) {}

  void along_row(int v, uint8_t* joined) const { join(v, 1, 0, grid_.w - 1, grid_.difference, joined); }
  /// `v` has a row below it.
  void down(int v, uint8_t* joined) const {
    join(v, grid_.w, 0, grid_.w, std::min({grid_.difference, v, grid_.h - 2 - v}), joined);
  }

private:
  /// `reach`: how far before and behind the pair the normals are compared.
  void join(int v, std::ptrdiff_t next, int u0, int u1, int reach, uint8_t* joined) const {
    const bool rows = next == 1;
    const size_t row = size_t(v) * size_t(grid_.w);
    const float *const d = smooth_ + row, *const limit = grid_.step + row;
    const float *const nx = normal_[0] + row, *const ny = normal_[1] + row, *const nz = normal_[2] + row;
    const float y0 = (float(v) - cy_) * fy_, y1 = rows ? y0 : y0 + fy_;
    for (int u = u0; u < u1; ++u) {
      const std::ptrdiff_t o = u + next;
      const float x0 = (float(u) - cx_) * fx_, x1 = rows ? x0 + fx_ : x0;
      const float px = d[o] * x1 - d[u] * x0, py = d[o] * y1 - d[u] * y0, pz = d[o] - d[u];
      const float off = std::fabs(nx[u] * px + ny[u] * py + nz[u] * pz);
      const float off_other = std::fabs(nx[o] * px + ny[o] * py + nz[o] * pz);
      const float tolerance = plane_of_step_ * limit[u];
      joined[u] = uint8_t((std::fabs(pz) < limit[u]) & (off < tolerance) & (off_other < tolerance) & (limit[o] > 0));
    }
    // Beside the ends of a row there are fewer pixels to compare.
    const int margin = rows ? std::min(reach, (u1 - u0) / 2) : 0;
    compare_normals(v, next, u0 + margin, u1 - margin, rows ? margin : reach, joined);
    for (int u = 0; u < margin; ++u) {
      compare_normals(v, next, u, u + 1, u, joined);
      compare_normals(v, next, u1 - 1 - u, u1 - u, u, joined);
    }
  }
  /// Normals beyond the pair, as long as they lie on its surface: smoothing spreads a crease over several pixels, so
  /// that neighbours alone always agree.
  void compare_normals(int v, std::ptrdiff_t next, int u0, int u1, int reach, uint8_t* joined) const {
    const size_t row = size_t(v) * size_t(grid_.w);
    const float *const d = smooth_ + row, *const limit = grid_.step + row;
    const float *const nx = normal_[0] + row, *const ny = normal_[1] + row, *const nz = normal_[2] + row;
    for (int u = u0; u < u1; ++u) {
      const std::ptrdiff_t o = u + next, far = reach * next;
      const std::ptrdiff_t a = std::fabs(d[u - far] - d[u]) < 2 * limit[u] ? u - far : u;
      const std::ptrdiff_t b = std::fabs(d[o + far] - d[u]) < 2 * limit[u] ? o + far : o;
      joined[u] &= uint8_t(nx[a] * nx[b] + ny[a] * ny[b] + nz[a] * nz[b] > least_cos_);
    }
  }

  const Grid& grid_;
  const float* smooth_;
  const float* normal_[3];
  float least_cos_, plane_of_step_, fx_, fy_, cx_, cy_;
};

/// Parts pixels of row `v` from the next one where the mean colours of three pixels on either side differ.
void part_by_color(const ColorImage& color, int v, bool rows, double largest, uint8_t* joined) {
  const int w = color.width();
  if (!rows && (v < 2 || v >= color.height() - 3)) return;
  const std::ptrdiff_t next = rows ? 1 : w;
  const int limit = int(9 * largest * largest);
  for (int u = rows ? 2 : 0; u < (rows ? w - 3 : w); ++u) {
    const Rgba8* const c = color.row(v) + u;
    int r = 0, g = 0, b = 0;
    for (int k = 0; k < 3; ++k) {
      const Rgba8 &before = c[-k * next], &after = c[(k + 1) * next];
      r += after.r - before.r, g += after.g - before.g, b += after.b - before.b;
    }
    joined[u] &= uint8_t(r * r + g * g + b * b <= limit);
  }
}

uint32_t root(std::vector<uint32_t>& parent, uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

constexpr uint32_t kNoPiece = 0xffffffff;

/// Replaces each pixel's parent by the number of its piece (in the order of first pixels), kNoPiece where nothing was
/// measured or the piece is too small, and counts the pixels of each.
void number_pieces(const Grid& grid, int min_pixels, std::vector<uint32_t>& parent, std::vector<uint32_t>& size) {
  size.clear();
  // A parent comes before its children: it already holds its number when they ask for it.
  for (uint32_t p = 0; p < parent.size(); ++p) {
    if (parent[p] == p) {
      parent[p] = uint32_t(size.size());
      size.push_back(0);
    } else {
      parent[p] = parent[parent[p]];
    }
    ++size[parent[p]];
  }
  for (uint32_t p = 0; p < parent.size(); ++p)
    if (!(grid.step[p] > 0) || int64_t(size[parent[p]]) < min_pixels) parent[p] = kNoPiece;
}

/// Gives pixels without a piece that of a neighbour within their depth step, nearest first.
void grow(const Grid& grid, FrameSegmentScratch& scratch) {
  const auto w = uint32_t(grid.w), pixels = uint32_t(scratch.parent.size());
  std::vector<uint32_t>&piece = scratch.parent, &wave = scratch.wave, &next = scratch.next;
  wave.clear(), next.clear();
  const auto open = [&](uint32_t p) { return piece[p] == kNoPiece && grid.step[p] > 0; };
  const auto spread = [&](uint32_t from, uint32_t to) {
    if (!open(to) || !(std::fabs(grid.depth[to] - grid.depth[from]) < grid.step[to])) return;
    piece[to] = piece[from];
    next.push_back(to);
  };
  const auto around = [&](uint32_t p, const auto& visit) {
    const uint32_t u = p % w;
    if (u > 0) visit(p - 1);
    if (u + 1 < w) visit(p + 1);
    if (p >= w) visit(p - w);
    if (p + w < pixels) visit(p + w);
  };
  // The first wave: pixels of pieces beside pixels without.
  for (uint32_t p = 0; p < pixels; ++p)
    if (open(p))
      around(p, [&](uint32_t q) {
        if (piece[q] != kNoPiece) wave.push_back(q);
      });
  std::sort(wave.begin(), wave.end());
  wave.erase(std::unique(wave.begin(), wave.end()), wave.end());
  while (!wave.empty()) {
    for (const uint32_t p : wave) around(p, [&](uint32_t q) { spread(p, q); });
    wave.swap(next);
    next.clear();
  }
}

/// Pieces that have pixels left, numbered from 1 in the order of their first pixel.
Image<uint16_t> numbered(const Grid& grid, const std::vector<uint32_t>& piece, std::vector<uint32_t>& number) {
  std::fill(number.begin(), number.end(), 0);
  Image<uint16_t> out(grid.w, grid.h, 0);
  uint32_t last = 0;
  for (size_t p = 0; p < piece.size(); ++p) {
    if (piece[p] == kNoPiece) continue;
    uint32_t& n = number[piece[p]];
    if (n == 0) n = ++last;
    out.data()[p] = n <= 0xffff ? uint16_t(n) : uint16_t(0);
  }
  return out;
}

}  // namespace

Image<uint16_t> frame_segments(const DepthImage& depth_m, const PinholeCamera& camera, const ColorImage& color,
                               const FrameSegmentSettings& settings, FrameSegmentScratch& scratch) {
  const int w = depth_m.width(), h = depth_m.height();
  if (depth_m.empty()) return {};
  prepare(depth_m, settings, scratch);
  // Chosen on 640 pixels across: a pixel of a smaller image covers more of the surface.
  const auto pixels = [&](double at_640) { return std::max(1, int(std::lround(at_640 * w / 640))); };
  const Grid grid{w, h, pixels(2), pixels(3), scratch.depth.data(), scratch.step.data()};
  scratch.smooth.resize(depth_m.size());
  scratch.spare.resize(depth_m.size());
  smooth_along(grid, grid.depth, 1, scratch.spare.data());
  smooth_along(grid, scratch.spare.data(), w, scratch.smooth.data());
  find_normals(grid, camera, scratch);

  const Joiner joiner(grid, camera, settings, scratch);
  const bool by_color = settings.color_step > 0 && color.width() == w && color.height() == h;
  std::vector<uint32_t>& parent = scratch.parent;
  parent.resize(depth_m.size());
  scratch.join_right.assign(size_t(w), 0);
  scratch.join_down.assign(size_t(w), 0);
  for (int v = 0; v < h; ++v) {
    joiner.along_row(v, scratch.join_right.data());
    if (by_color) part_by_color(color, v, true, settings.color_step, scratch.join_right.data());
    for (int u = 0; u < w; ++u) {
      const auto p = uint32_t(v * w + u);
      const bool left = u > 0 && scratch.join_right[size_t(u - 1)], up = v > 0 && scratch.join_down[size_t(u)];
      parent[p] = left ? parent[p - 1] : p;
      if (!up || parent[p] == parent[p - uint32_t(w)]) continue;
      const uint32_t a = root(parent, p), b = root(parent, p - uint32_t(w));
      parent[std::max(a, b)] = std::min(a, b);
      parent[p] = std::min(a, b);
    }
    if (v + 1 == h) break;
    joiner.down(v, scratch.join_down.data());
    if (by_color) part_by_color(color, v, false, settings.color_step, scratch.join_down.data());
  }
  number_pieces(grid, settings.min_pixels, parent, scratch.size);
  grow(grid, scratch);
  return numbered(grid, parent, scratch.size);
}

Image<uint16_t> frame_segments(const DepthImage& depth_m, const PinholeCamera& camera, const ColorImage& color,
                               const FrameSegmentSettings& settings) {
  FrameSegmentScratch scratch;
  return frame_segments(depth_m, camera, color, settings, scratch);
}

}  // namespace felt
