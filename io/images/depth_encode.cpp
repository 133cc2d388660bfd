#include "io/images/depth_encode.h"

#include <cmath>

namespace felt {

Image<uint16_t> stored_depth(const DepthImage& depth_m, double depth_scale, int64_t& out_of_range) {
  Image<uint16_t> stored(depth_m.width(), depth_m.height());
  for (size_t p = 0; p < depth_m.size(); ++p) {
    const double value = std::round(double(depth_m.data()[p]) * depth_scale);
    const bool fits = value >= 1 && value < 65535;
    stored.data()[p] = fits ? uint16_t(value) : 0;
    out_of_range += !fits && depth_m.data()[p] > 0;
  }
  return stored;
}

}  // namespace felt
