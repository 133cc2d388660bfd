#pragma once

#include <cstdint>

#include "mapping/fusion/depth_tiles.h"

namespace felt {

// What is found out about a depth image before blocks are looked at: where depth lies, and the blocks it falls into.
// Every target gives the scalar version's bits.

/// Range of usable depth in one tile of 8 x 8 pixels (fewer at the right and lower edge), and of a row of tiles.
DepthRange tile_range(const float* depth_m, int width, int height, int tile_row, int tile_column, float min_depth_m,
                      float max_depth_m) noexcept;
void tile_range_row(const float* depth_m, int width, int height, int tile_row, float min_depth_m, float max_depth_m,
                    DepthRange* tiles) noexcept;
void tile_range_row_scalar(const float* depth_m, int width, int height, int tile_row, float min_depth_m,
                           float max_depth_m, DepthRange* tiles) noexcept;

/// out[i] = range of tiles i, i + 1 and i + 2 of three rows, `stride` tiles apart; i < count.
void spread_range_row(const DepthRange* tiles, int stride, DepthRange* out, int count) noexcept;
void spread_range_row_scalar(const DepthRange* tiles, int stride, DepthRange* out, int count) noexcept;

/// Depth pixels as they mark blocks: q(u, v, d) = origin + d (ray0 + u ray_u + v ray_v) in units of blocks, relative to
/// a box of cells. A cell is marked where a sample of [d - truncation, d + truncation] falls.
struct AllocationView {
  float origin[3] = {}, ray0[3] = {}, ray_u[3] = {}, ray_v[3] = {};
  int cells[3] = {};                 ///< extent of the box
  const float* offsets_m = nullptr;  ///< samples along the ray, relative to d
  int samples = 0;
};

/// Some pixels of one image row, with their depth.
struct RowSamples {
  static constexpr int kMost = 256;
  alignas(64) float u[kMost], depth_m[kMost];
  int count = 0;
};

/// Marks cells (row-major x, y, z; one byte each) seen by pixels of image row `v`. One more byte behind the last cell
/// takes what falls outside: it may be marked or not. Cells may be written by several rows at once: all write the same
/// value. Reads and overwrites `row` beyond its count, up to a whole vector.
void mark_cells(const AllocationView& view, int v, RowSamples& row, uint8_t* cells) noexcept;
void mark_cells_scalar(const AllocationView& view, int v, RowSamples& row, uint8_t* cells) noexcept;

}  // namespace felt
