#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "mapping/store/block_store.h"
#include "mapping/store/region.h"

namespace felt {

/// A read-only second index over the blocks of a store, for rays: two levels of 8^3, so that a ray steps over a group
/// of 8^3 absent blocks at once and finds the next block without hashing; and for each block the cells that the surface
/// can cross. Cell (x, y, z) is the cube between voxel centres x and x + 1 and so on: its corners may lie in up to
/// eight blocks. Valid until the map changes.
class BlockIndex {
public:
  static constexpr uint32_t kNone = BlockStore::kNone;

  /// 8^3 blocks, by offset_in_block of their coordinates.
  struct Group {
    std::array<uint32_t, kBlockVoxels> block;     ///< number in the store, or kNone
    std::array<uint32_t, kBlockVoxels> crossing;  ///< number of its mask, or kNone where no cell is crossed
  };

  /// Parallel. A voxel counts as observed from `min_weight` on.
  BlockIndex(const BlockStore& store, float min_weight);

  /// The group with these coordinates (those of its blocks / 8), or nothing.
  const Group* group(const Index3& coord) const {
    if (dense_.empty()) {
      const auto found = groups_.find(coord);
      return found == groups_.end() ? nullptr : &children_[found->second];
    }
    const uint32_t x = uint32_t(coord.x - first_.x), y = uint32_t(coord.y - first_.y), z = uint32_t(coord.z - first_.z);
    if (x >= size_[0] || y >= size_[1] || z >= size_[2]) return nullptr;
    const uint32_t child = dense_[(size_t(x) * size_[1] + y) * size_[2] + z];
    return child == kNone ? nullptr : &children_[child];
  }
  uint32_t find(const BlockCoord& block) const {
    const Group* g = group(block_of_voxel(block));
    return g == nullptr ? kNone : g->block[size_t(offset_in_block(block))];
  }
  /// Cells whose corners were all observed and lie on both sides of the surface, by offset of their first voxel.
  const BlockMask& mask(uint32_t crossing) const { return masks_[crossing]; }
  /// Blocks that have such cells, in the order of their masks.
  std::span<const BlockCoord> crossed() const { return crossed_; }

  /// Box of all blocks; low > high where there is none.
  const BlockCoord& low() const { return low_; }
  const BlockCoord& high() const { return high_; }

private:
  BlockMask crossed_cells(const BlockStore& store, uint32_t block, float min_weight) const;

  BlockCoord low_{0, 0, 0}, high_{-1, -1, -1};
  std::unordered_map<Index3, uint32_t> groups_;
  Index3 first_;  ///< group at the beginning of `dense_`
  std::array<uint32_t, 3> size_{};
  std::vector<uint32_t> dense_;  ///< groups of the whole box, where it is not too large
  std::vector<Group> children_;
  std::vector<BlockMask> masks_;
  std::vector<BlockCoord> crossed_;
};

}  // namespace felt
