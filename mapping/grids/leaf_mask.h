#pragma once

#include <cstdint>
#include <cstring>

#include "mapping/store/block_store.h"
#include "mapping/store/region.h"

namespace felt {

/// The voxels i of a block where `active(i)`.
template <typename Active>
BlockMask mask_where(const Active& active) {
  BlockMask mask;
  for (int x = 0; x < kBlockDim; ++x) {
    uint8_t on[64];  // apart from the packing, so that the compiler does 16 comparisons at once
    for (int i = 0; i < 64; ++i) on[i] = active(x << 6 | i) ? 1 : 0;
    for (int y = 0; y < kBlockDim; ++y) {
      uint64_t bytes;
      std::memcpy(&bytes, on + 8 * y, sizeof bytes);
      mask.word[size_t(x)] |= (bytes * 0x0102040810204080u >> 56) << (8 * y);  // byte j to bit j
    }
  }
  return mask;
}

/// The voxels of a block with a weight.
inline BlockMask observed_voxels(const Block& block) {
  return mask_where([weight = block.geometry->weight](int i) { return weight[i] > 0; });
}

}  // namespace felt
