#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "mapping/block_store.h"

namespace felt {

/// A read-only second index over the blocks of a store, for rays: two levels of 8^3, so that a ray steps over a cell of
/// 8^3 absent blocks at once and finds the next block without hashing. Valid until blocks are added.
class BlockIndex {
public:
  static constexpr uint32_t kNone = BlockStore::kNone;

  /// Parallel. A voxel counts as observed from `min_weight` on.
  BlockIndex(const BlockStore& store, float min_weight);

  /// One cell of 8^3 blocks: the block's number, or kNone.
  using Cell = std::array<uint32_t, kBlockVoxels>;

  /// The cell that holds a block, or nothing.
  const Cell* cell(const BlockCoord& block) const {
    const auto found = cells_.find(block_of_voxel(block));
    return found == cells_.end() ? nullptr : &children_[found->second];
  }
  uint32_t find(const BlockCoord& block) const {
    const Cell* c = cell(block);
    return c == nullptr ? kNone : (*c)[size_t(offset_in_block(block))];
  }
  /// Whether the surface can pass through a block, or between it and its neighbours: it or one of the 26 around it has
  /// an observed voxel behind the surface.
  bool near_surface(uint32_t block) const { return near_surface_[block] != 0; }

  /// Box of all blocks; low > high where there is none.
  const BlockCoord& low() const { return low_; }
  const BlockCoord& high() const { return high_; }

private:
  BlockCoord low_{0, 0, 0}, high_{-1, -1, -1};
  std::unordered_map<Index3, uint32_t> cells_;
  std::vector<Cell> children_;
  std::vector<uint8_t> near_surface_;
};

}  // namespace felt
