#pragma once

#include <algorithm>
#include <vector>

#include "core/image.h"

namespace felt::paper {

/// Images of one size in rows of `columns`, white between them.
inline ColorImage tiled(const std::vector<ColorImage>& panels, int columns) {
  constexpr int kGap = 4;
  const int w = panels[0].width(), h = panels[0].height(), rows = (int(panels.size()) + columns - 1) / columns;
  ColorImage picture(columns * (w + kGap) - kGap, rows * (h + kGap) - kGap, {255, 255, 255, 255});
  for (size_t i = 0; i < panels.size(); ++i) {
    const int u0 = int(i) % columns * (w + kGap), v0 = int(i) / columns * (h + kGap);
    for (int v = 0; v < h; ++v) std::copy_n(panels[i].row(v), w, picture.row(v0 + v) + u0);
  }
  return picture;
}

}  // namespace felt::paper
