#include <algorithm>
#include <atomic>
#include <cstddef>
#include <limits>

#include "mapping/fusion/survey_kernels.h"

namespace felt {

DepthRange tile_range(const float* depth_m, int width, int height, int tile_row, int tile_column, float min_depth_m,
                      float max_depth_m) noexcept {
  constexpr int kTile = DepthTiles::kFinestTile;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  DepthRange range{kInfinity, kInfinity};
  for (int v = tile_row * kTile; v < std::min(height, (tile_row + 1) * kTile); ++v)
    for (int u = tile_column * kTile; u < std::min(width, (tile_column + 1) * kTile); ++u) {
      const float d = depth_m[size_t(v) * width + u];
      if (!(d >= min_depth_m && d <= max_depth_m)) continue;
      range.nearest_m = std::min(range.nearest_m, d);
      range.minus_farthest_m = std::min(range.minus_farthest_m, -d);
    }
  return range;
}

void tile_range_row_scalar(const float* depth_m, int width, int height, int tile_row, float min_depth_m,
                           float max_depth_m, DepthRange* tiles) noexcept {
  for (int column = 0; column * DepthTiles::kFinestTile < width; ++column)
    tiles[column] = tile_range(depth_m, width, height, tile_row, column, min_depth_m, max_depth_m);
}

void spread_range_row_scalar(const DepthRange* tiles, int stride, DepthRange* out, int count) noexcept {
  for (int i = 0; i < count; ++i) {
    out[i] = tiles[i];
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column) {
        const DepthRange& tile = tiles[row * stride + i + column];
        out[i].nearest_m = std::min(out[i].nearest_m, tile.nearest_m);
        out[i].minus_farthest_m = std::min(out[i].minus_farthest_m, tile.minus_farthest_m);
      }
  }
}

void mark_cells_scalar(const AllocationView& view, int v, RowSamples& row, uint8_t* cells) noexcept {
  for (int i = 0; i < row.count; ++i)
    for (int s = 0; s < view.samples; ++s) {
      const float along = row.depth_m[i] + view.offsets_m[s];
      int32_t cell[3];
      bool inside = true;
      for (int c = 0; c < 3; ++c) {
        const float direction = view.ray0[c] + float(v) * view.ray_v[c] + row.u[i] * view.ray_u[c];
        const float q = view.origin[c] + along * direction;
        inside = inside && q >= 0 && q < float(view.cells[c]);
        cell[c] = inside ? int32_t(q) : 0;
      }
      if (!inside) continue;
      uint8_t& mark = cells[(size_t(cell[0]) * view.cells[1] + cell[1]) * view.cells[2] + cell[2]];
      std::atomic_ref<uint8_t>(mark).store(1, std::memory_order_relaxed);
    }
}

}  // namespace felt
