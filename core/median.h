#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace felt {

/// The middle of the values in ascending order: of an even number of them the upper one of the two, of none 0.
inline double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + std::ptrdiff_t(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace felt
