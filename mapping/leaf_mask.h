#pragma once

#include <cstdint>

#include "core/block.h"

namespace felt {

/// Sets a leaf's value mask, a 64-bit word at a time: voxel i is active where `active(i)`.
template <typename Leaf, typename Active>
void set_active(Leaf& leaf, Active active) {
  auto mask = leaf.getValueMask();
  for (int x = 0; x < kBlockDim; ++x) {
    uint64_t word = 0;
    for (int i = 0; i < 64; ++i) word |= uint64_t(active(x << 6 | i)) << i;
    mask.template getWord<uint64_t>(x) = word;
  }
  leaf.setValueMask(mask);
}

}  // namespace felt
