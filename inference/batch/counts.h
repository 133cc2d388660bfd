#pragma once

#include <cstddef>

namespace felt {

/// What became of the voxels of a batch.
struct BatchCounts {
  size_t updated = 0;
  size_t refused = 0;   ///< asked for, but left alone
  size_t computed = 0;  ///< distinct states computed
  bool operator==(const BatchCounts&) const = default;
};

inline BatchCounts operator+(const BatchCounts& a, const BatchCounts& b) {
  return {a.updated + b.updated, a.refused + b.refused, a.computed + b.computed};
}

}  // namespace felt
