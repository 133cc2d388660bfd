#include "mapping/labels/frame_segments.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numbers>

#include "mapping/labels/frame_segment_kernels.h"

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
    const bool measured = (d > 0) & (d < 1e6f);
    scratch.depth[p] = measured ? d : 0.0f;
    scratch.step[p] = measured ? base * std::max(1.0f, d * d * scale) : -1.0f;
  }
}

/// Where a plane begins its row `v`.
DepthRow row_of(const Grid& grid, int v) {
  const size_t row = size_t(v) * size_t(grid.w);
  return {grid.depth + row, grid.step + row};
}

/// Calls `smooth(row, first, end)` for the pixels of each row that have all neighbours to average over along rows or
/// columns, and `copy(v, first, end)` for those that have not and stay as they are.
template <typename Smooth, typename Copy>
void for_smoothed_rows(const Grid& grid, bool along_rows, const Smooth& smooth, const Copy& copy) {
  const int reach = grid.smoothing;
  for (int v = 0; v < grid.h; ++v) {
    if (along_rows ? grid.w <= 2 * reach : v < reach || v >= grid.h - reach) {
      copy(v, 0, grid.w);
    } else if (along_rows) {
      copy(v, 0, reach);
      smooth(v, reach, grid.w - reach);
      copy(v, grid.w - reach, grid.w);
    } else {
      smooth(v, 0, grid.w);
    }
  }
}

/// Mean of depth over the pixels up to `smoothing` to either side that lie on the same surface, along rows (`stride` 1)
/// or columns (`stride` w).
void smooth_along(const Grid& grid, const float* value, std::ptrdiff_t stride, float* mean) {
  for_smoothed_rows(
      grid, stride == 1,
      [&](int v, int first, int end) {
        const size_t row = size_t(v) * size_t(grid.w);
        smooth_row(row_of(grid, v), stride, grid.smoothing, first, end, value + row, mean + row);
      },
      [&](int v, int first, int end) {
        const size_t row = size_t(v) * size_t(grid.w);
        std::copy(value + row + first, value + row + end, mean + row + first);
      });
}

/// The same for the normals, which are scaled to length 1 after it where `unit` is set.
void smooth_normals_along(const Grid& grid, const std::vector<float> (&value)[3], std::ptrdiff_t stride, bool unit,
                          std::vector<float> (&mean)[3]) {
  const auto smooth = [&](int v, int reach, int first, int end) {
    const size_t row = size_t(v) * size_t(grid.w);
    const float* const from[3] = {value[0].data() + row, value[1].data() + row, value[2].data() + row};
    float* const to[3] = {mean[0].data() + row, mean[1].data() + row, mean[2].data() + row};
    smooth_normal_row(row_of(grid, v), stride, reach, first, end, from, to, unit);
  };
  for_smoothed_rows(
      grid, stride == 1, [&](int v, int first, int end) { smooth(v, grid.smoothing, first, end); },
      [&](int v, int first, int end) { smooth(v, 0, first, end); });
}

/// Unit normals of the smoothed depth, themselves smoothed, pointing away from the camera.
void find_normals(const Grid& grid, const PinholeCamera& camera, FrameSegmentScratch& scratch) {
  const int w = grid.w, k = grid.difference;
  for (auto& plane : scratch.normal) plane.resize(scratch.depth.size());
  for (auto& plane : scratch.spare_normal) plane.resize(scratch.depth.size());
  const int left = std::min(k, w), right = std::max(left, w - k);
  for (int v = 0; v < grid.h; ++v) {
    const size_t row = size_t(v) * size_t(w);
    float* const normal[3] = {scratch.normal[0].data() + row, scratch.normal[1].data() + row,
                              scratch.normal[2].data() + row};
    NormalView view{float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy), w, k, {}, {}, {}, {}};
    view.up = v >= k, view.down = v + k < grid.h;
    const auto run = [&](int first, int end) {
      view.left = first >= k, view.right = end + k <= w;
      normal_row(view, {scratch.smooth.data() + row, grid.step + row}, v, first, end, normal);
    };
    for (int u = 0; u < left; ++u) run(u, u + 1);
    if (left < right) run(left, right);
    for (int u = right; u < w; ++u) run(u, u + 1);
  }
  smooth_normals_along(grid, scratch.normal, 1, false, scratch.spare_normal);
  smooth_normals_along(grid, scratch.spare_normal, w, true, scratch.normal);
}

/// Decides for one row which pixels are joined to the next along the row, or to the one below.
class Joiner {
public:
  Joiner(const Grid& grid, const PinholeCamera& camera, const FrameSegmentSettings& s, const FrameSegmentScratch& t)
      : grid_(grid),
        image_{{t.smooth.data(), grid.step},
               {t.normal[0].data(), t.normal[1].data(), t.normal[2].data()},
               float(1 / camera.fx),
               float(1 / camera.fy),
               float(camera.cx),
               float(camera.cy),
               float(std::cos(s.normal_change_deg * std::numbers::pi / 180)),
               float(s.plane_distance_m / s.depth_step_m)} {}

  void along_row(int v, uint8_t* joined) const {
    const SurfaceRow surface = row_of_surface(v);
    const int end = grid_.w - 1;
    join_row(surface, v, 1, 0, end, joined);
    // Beside the ends of a row there are fewer pixels to compare.
    const int margin = std::min(grid_.difference, end / 2);
    part_row_by_normals(surface, 1, margin, margin, end - margin, joined);
    for (int u = 0; u < margin; ++u) {
      part_row_by_normals(surface, 1, u, u, u + 1, joined);
      part_row_by_normals(surface, 1, u, end - 1 - u, end - u, joined);
    }
  }
  /// `v` has a row below it.
  void down(int v, uint8_t* joined) const {
    const SurfaceRow surface = row_of_surface(v);
    join_row(surface, v, grid_.w, 0, grid_.w, joined);
    part_row_by_normals(surface, grid_.w, std::min({grid_.difference, v, grid_.h - 2 - v}), 0, grid_.w, joined);
  }

private:
  SurfaceRow row_of_surface(int v) const {
    const size_t row = size_t(v) * size_t(grid_.w);
    SurfaceRow surface = image_;
    surface.row.depth += row, surface.row.step += row;
    for (const float*& plane : surface.normal) plane += row;
    return surface;
  }

  const Grid& grid_;
  SurfaceRow image_;  ///< of row 0
};

/// Parts pixels of row `v` from the next one where the mean colours of three pixels on either side differ.
void part_by_color(const ColorImage& color, int v, bool rows, double largest, uint8_t* joined) {
  const int w = color.width(), limit = int(9 * largest * largest);
  if (rows)
    part_row_by_color(color.row(v), 1, limit, 2, w - 3, joined);
  else if (v >= 2 && v < color.height() - 3)
    part_row_by_color(color.row(v), w, limit, 0, w, joined);
}

uint32_t root(std::vector<uint32_t>& parent, uint32_t i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

/// Adds the runs of one row, pixels joined to the next, to the union-find and unites them with those of the row above
/// that a pixel is joined to. `above`: first run of that row. `join_right` of the last pixel is 0.
void add_runs(int w, size_t above, const uint8_t* join_right, const uint8_t* join_down, uint32_t first_pixel,
              FrameSegmentScratch& scratch) {
  std::vector<uint32_t>&begin = scratch.run, &parent = scratch.parent;
  const size_t first = begin.size();
  for (int u = 0; u < w;) {
    parent.push_back(uint32_t(begin.size()));
    begin.push_back(first_pixel + uint32_t(u));
    u = int(static_cast<const uint8_t*>(std::memchr(join_right + u, 0, size_t(w - u))) - join_right) + 1;
  }
  const auto width = uint32_t(w);
  for (size_t a = above, b = first; a < first && b < begin.size();) {
    const uint32_t end_a = (a + 1 < first ? begin[a + 1] : first_pixel) + width;
    const uint32_t end_b = b + 1 < begin.size() ? begin[b + 1] : first_pixel + width;
    const uint32_t from = std::max(begin[a] + width, begin[b]), to = std::min(end_a, end_b);
    if (std::memchr(join_down + (from - first_pixel), 1, to - from) != nullptr) {
      const uint32_t i = root(parent, uint32_t(a)), j = root(parent, uint32_t(b));
      parent[std::max(i, j)] = std::min(i, j);
    }
    a += end_a == to, b += end_b == to;
  }
}

constexpr uint32_t kNoPiece = 0xffffffff;

/// Writes the number of its piece (in the order of first pixels) to each pixel, kNoPiece where nothing was measured or
/// the piece is too small, and lists the measured pixels of those. `scratch.size` then has an element for each piece.
void number_pieces(const Grid& grid, int min_pixels, FrameSegmentScratch& scratch) {
  std::vector<uint32_t>&begin = scratch.run, &parent = scratch.parent, &size = scratch.size;
  size.clear();
  begin.push_back(uint32_t(scratch.piece.size()));
  // A parent comes before its children: it already holds its number when they ask for it.
  for (uint32_t i = 0; i < parent.size(); ++i) {
    if (parent[i] == i) {
      parent[i] = uint32_t(size.size());
      size.push_back(0);
    } else {
      parent[i] = parent[parent[i]];
    }
    size[parent[i]] += begin[i + 1] - begin[i];
  }
  scratch.open.clear();
  for (size_t i = 0; i < parent.size(); ++i) {
    // What was not measured is joined to nothing: a run of its own.
    const bool measured = grid.step[begin[i]] > 0, kept = measured && int64_t(size[parent[i]]) >= min_pixels;
    std::fill(scratch.piece.begin() + begin[i], scratch.piece.begin() + begin[i + 1], kept ? parent[i] : kNoPiece);
    for (uint32_t p = begin[i]; measured && !kept && p < begin[i + 1]; ++p) scratch.open.push_back(p);
  }
}

/// Gives pixels without a piece that of a neighbour within their depth step, nearest first.
void grow(const Grid& grid, FrameSegmentScratch& scratch) {
  const auto w = uint32_t(grid.w), pixels = uint32_t(scratch.piece.size());
  std::vector<uint32_t>&piece = scratch.piece, &wave = scratch.wave, &next = scratch.next;
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
  for (const uint32_t p : scratch.open)
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
  scratch.piece.resize(depth_m.size());
  scratch.run.clear(), scratch.parent.clear();
  scratch.join_right.assign(size_t(w), 0);
  scratch.join_down.assign(size_t(w), 0);
  size_t above = 0;
  for (int v = 0; v < h; ++v) {
    joiner.along_row(v, scratch.join_right.data());
    if (by_color) part_by_color(color, v, true, settings.color_step, scratch.join_right.data());
    const size_t first = scratch.run.size();
    add_runs(w, above, scratch.join_right.data(), scratch.join_down.data(), uint32_t(v) * uint32_t(w), scratch);
    above = first;
    if (v + 1 == h) break;
    joiner.down(v, scratch.join_down.data());
    if (by_color) part_by_color(color, v, false, settings.color_step, scratch.join_down.data());
  }
  number_pieces(grid, settings.min_pixels, scratch);
  grow(grid, scratch);
  return numbered(grid, scratch.piece, scratch.size);
}

Image<uint16_t> frame_segments(const DepthImage& depth_m, const PinholeCamera& camera, const ColorImage& color,
                               const FrameSegmentSettings& settings) {
  FrameSegmentScratch scratch;
  return frame_segments(depth_m, camera, color, settings, scratch);
}

}  // namespace felt
