#include "mapping/regions/view_mask.h"

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <algorithm>

namespace felt {

uint64_t digest(const ViewMask& view) {
  XXH3_state_t state;
  XXH3_INITSTATE(&state);
  XXH3_64bits_reset(&state);
  const PinholeCamera& c = view.camera;
  for (const double number : {c.fx, c.fy, c.cx, c.cy, double(c.width), double(c.height)})
    XXH3_64bits_update(&state, &number, sizeof number);
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) {
      const double number = view.T_world_camera(row, column) + 0.0;  // -0 is 0
      XXH3_64bits_update(&state, &number, sizeof number);
    }
  for (int y = 0; y < view.mask.height(); ++y)
    for (int x = 0; x < view.mask.width(); ++x) {
      const uint8_t inside = view.mask(x, y) != 0;
      XXH3_64bits_update(&state, &inside, 1);
    }
  return std::max<uint64_t>(XXH3_64bits_digest(&state), 1);
}

}  // namespace felt
