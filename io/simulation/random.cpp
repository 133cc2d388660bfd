#include "io/simulation/random.h"

#include <cmath>
#include <numbers>

namespace felt {

double standard_normal(uint64_t bits) {
  const double radius = std::sqrt(-2 * std::log((double(bits >> 32) + 0.5) * 0x1p-32));
  return radius * std::cos(2 * std::numbers::pi * (double(bits & 0xffffffffu) * 0x1p-32));
}

}  // namespace felt
