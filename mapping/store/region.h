#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/block.h"

namespace felt {

/// One bit per voxel of a block, 64 bytes: word x, bit y << 3 | z. The words of an OpenVDB leaf's value mask.
struct alignas(64) BlockMask {
  std::array<uint64_t, 8> word{};

  bool test(int offset) const { return word[offset >> 6] >> (offset & 63) & 1; }
  void set(int offset) { word[offset >> 6] |= uint64_t(1) << (offset & 63); }
  bool any() const {
    uint64_t all = 0;
    for (const uint64_t w : word) all |= w;
    return all != 0;
  }
  int count() const {
    int n = 0;
    for (const uint64_t w : word) n += std::popcount(w);
    return n;
  }
  BlockMask& operator|=(const BlockMask& o) {
    for (int i = 0; i < 8; ++i) word[i] |= o.word[i];
    return *this;
  }
  BlockMask& operator&=(const BlockMask& o) {
    for (int i = 0; i < 8; ++i) word[i] &= o.word[i];
    return *this;
  }
  /// Clears the bits that are set in `o`.
  BlockMask& operator-=(const BlockMask& o) {
    for (int i = 0; i < 8; ++i) word[i] &= ~o.word[i];
    return *this;
  }
  friend BlockMask operator|(BlockMask a, const BlockMask& b) { return a |= b; }
  friend BlockMask operator&(BlockMask a, const BlockMask& b) { return a &= b; }
  friend BlockMask operator-(BlockMask a, const BlockMask& b) { return a -= b; }
  bool operator==(const BlockMask&) const = default;
};

/// Calls `visit(offset)` for each set bit in ascending order.
template <typename Visit>
void for_each_bit(const BlockMask& mask, const Visit& visit) {
  for (int x = 0; x < 8; ++x)
    for (uint64_t w = mask.word[x]; w != 0; w &= w - 1) visit(x << 6 | std::countr_zero(w));
}

/// A set of voxels: blocks in ascending order, each with at least one bit.
struct Region {
  std::vector<BlockCoord> coord;
  std::vector<BlockMask> mask;

  size_t blocks() const { return coord.size(); }
  bool empty() const { return coord.empty(); }
  size_t voxels() const;
  /// The mask of a block, or null where the region has no voxel in it. O(log blocks).
  const BlockMask* find(const BlockCoord& block) const;
  bool contains(const Index3& voxel) const;
  void append(const BlockCoord& block, const BlockMask& bits) {
    coord.push_back(block);
    mask.push_back(bits);
  }
  bool operator==(const Region&) const = default;
};

Region united(const Region& a, const Region& b);
Region intersected(const Region& a, const Region& b);
/// Voxels of `a` that are not in `b`.
Region subtracted(const Region& a, const Region& b);

/// 26-neighbour dilation of a block's bits by one voxel; entry 9 (dx + 1) + 3 (dy + 1) + dz + 1 goes to the block at
/// offset (dx, dy, dz), entry 13 is the block itself.
std::array<BlockMask, 27> dilated(const BlockMask& bits);
/// The same within the block only.
BlockMask dilated_inside(const BlockMask& bits);

}  // namespace felt
