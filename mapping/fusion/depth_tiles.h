#pragma once

#include <cstddef>
#include <vector>

namespace felt {

/// Nearest and farthest usable depth of some pixels, metres, the farthest negated: the range of two sets of pixels is
/// the smaller of each. Infinity where no pixel is usable.
struct DepthRange {
  float nearest_m, minus_farthest_m;
};

/// What depth can be found around a place of the image, at four sizes of place: a block of voxels asks this before it
/// reads any depth.
struct DepthTiles {
  static constexpr int kLevels = 4;
  static constexpr int kFinestTile = 8;  ///< pixels; each level doubles it
  static constexpr int kMargin = 2;      ///< tiles without depth on each side of `tiles`

  struct Level {
    int tile_px = 0;
    int columns = 0, rows = 0;       ///< tiles that cover the image
    std::vector<DepthRange> tiles;   ///< (columns + 4) x (rows + 4): with the margin
    std::vector<DepthRange> around;  ///< (columns + 2) x (rows + 2): range of each tile and the eight around it, and so
                                     ///< of every pixel within tile_px of a pixel of the tile. One tile of margin.

    int stride() const { return columns + 2 * kMargin; }
    int around_stride() const { return columns + 2; }
    DepthRange* row(int tile_row) { return &tiles[size_t(tile_row + kMargin) * stride() + kMargin]; }
    const DepthRange* row(int tile_row) const { return &tiles[size_t(tile_row + kMargin) * stride() + kMargin]; }
  };
  Level levels[kLevels];
};

/// Shapes the levels for an image of this size. The tiles of the finest level are for the caller to fill, row by row
/// (tile_range_row), before `spread_ranges`.
void shape_tiles(int width, int height, DepthTiles& tiles);
/// Fills everything else from the finest tiles.
void spread_ranges(DepthTiles& tiles);
/// Range over the whole image, from the finest tiles.
DepthRange range_of_image(const DepthTiles& tiles);

}  // namespace felt
