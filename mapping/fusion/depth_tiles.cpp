#include "mapping/fusion/depth_tiles.h"

#include <limits>

#include "mapping/fusion/survey_kernels.h"

namespace felt {
namespace {

constexpr DepthRange kNoDepth{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity()};

DepthRange united(DepthRange a, DepthRange b) {
  return {b.nearest_m < a.nearest_m ? b.nearest_m : a.nearest_m,
          b.minus_farthest_m < a.minus_farthest_m ? b.minus_farthest_m : a.minus_farthest_m};
}

/// Tiles of twice the size. An odd last row or column takes its partner from the margin.
void halve(const DepthTiles::Level& fine, DepthTiles::Level& coarse) {
  for (int r = 0; r < coarse.rows; ++r) {
    const DepthRange *upper = fine.row(2 * r), *lower = fine.row(2 * r + 1);
    DepthRange* out = coarse.row(r);
    for (int c = 0; c < coarse.columns; ++c)
      out[c] = united(united(upper[2 * c], upper[2 * c + 1]), united(lower[2 * c], lower[2 * c + 1]));
  }
}

}  // namespace

void shape_tiles(int width, int height, DepthTiles& tiles) {
  int tile_px = DepthTiles::kFinestTile;
  for (DepthTiles::Level& level : tiles.levels) {
    const int columns = (width + tile_px - 1) / tile_px, rows = (height + tile_px - 1) / tile_px;
    if (level.columns != columns || level.rows != rows) {
      level.tile_px = tile_px, level.columns = columns, level.rows = rows;
      level.tiles.assign(size_t(level.stride()) * (rows + 2 * DepthTiles::kMargin), kNoDepth);
      level.around.assign(size_t(level.around_stride()) * (rows + 2), kNoDepth);
    }
    tile_px *= 2;
  }
}

void spread_ranges(DepthTiles& tiles) {
  const DepthTiles::Level* finer = nullptr;
  for (DepthTiles::Level& level : tiles.levels) {
    if (finer != nullptr) halve(*finer, level);
    for (int r = 0; r < level.rows + 2; ++r)
      spread_range_row(&level.tiles[size_t(r) * level.stride()], level.stride(),
                       &level.around[size_t(r) * level.around_stride()], level.around_stride());
    finer = &level;
  }
}

DepthRange range_of_image(const DepthTiles& tiles) {
  const DepthTiles::Level& finest = tiles.levels[0];
  DepthRange all = kNoDepth;
  for (int r = 0; r < finest.rows; ++r)
    for (int c = 0; c < finest.columns; ++c) all = united(all, finest.row(r)[c]);
  return all;
}

}  // namespace felt
