#include "mapping/store/block_index.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace felt {
namespace {

constexpr uint8_t kFront = 1, kBehind = 2, kUnknown = 4;
constexpr int kCorners = kBlockDim + 1;  ///< along each axis of a block's cells
constexpr size_t kMostDense = size_t(1) << 22;

uint8_t side_of(const GeometryPlanes& planes, int offset, float min_weight) {
  if (!(planes.weight[offset] >= min_weight)) return kUnknown;
  return planes.tsdf[offset] > 0 ? kFront : kBehind;
}

}  // namespace

BlockIndex::BlockIndex(const BlockStore& store, float min_weight) {
  for (uint32_t i = 0; i < store.size(); ++i) {
    const BlockCoord& c = store[i].coord;
    low_ = i == 0 ? c : BlockCoord{std::min(low_.x, c.x), std::min(low_.y, c.y), std::min(low_.z, c.z)};
    high_ = i == 0 ? c : BlockCoord{std::max(high_.x, c.x), std::max(high_.y, c.y), std::max(high_.z, c.z)};
    const auto [found, is_new] = groups_.try_emplace(block_of_voxel(c), uint32_t(children_.size()));
    if (is_new) {
      children_.emplace_back();
      children_.back().block.fill(kNone);
      children_.back().crossing.fill(kNone);
    }
    children_[found->second].block[size_t(offset_in_block(c))] = i;
  }
  if (store.empty()) return;
  first_ = block_of_voxel(low_);
  const Index3 last = block_of_voxel(high_);
  const std::array<size_t, 3> size{size_t(last.x - first_.x) + 1, size_t(last.y - first_.y) + 1,
                                   size_t(last.z - first_.z) + 1};
  if (std::max({size[0], size[1], size[2]}) <= kMostDense && size[0] * size[1] <= kMostDense &&
      size[0] * size[1] * size[2] <= kMostDense) {
    size_ = {uint32_t(size[0]), uint32_t(size[1]), uint32_t(size[2])};
    dense_.assign(size[0] * size[1] * size[2], kNone);
    for (const auto& [coord, child] : groups_)
      dense_[(size_t(coord.x - first_.x) * size[1] + size_t(coord.y - first_.y)) * size[2] +
             size_t(coord.z - first_.z)] = child;
  }
  std::vector<BlockMask> masks(store.size());
  tbb::parallel_for(size_t(0), store.size(),
                    [&](size_t i) { masks[i] = crossed_cells(store, uint32_t(i), min_weight); });
  for (uint32_t i = 0; i < store.size(); ++i) {
    if (!masks[i].any()) continue;
    const BlockCoord& c = store[i].coord;
    children_[groups_.at(block_of_voxel(c))].crossing[size_t(offset_in_block(c))] = uint32_t(masks_.size());
    masks_.push_back(masks[i]);
    crossed_.push_back(c);
  }
}

BlockMask BlockIndex::crossed_cells(const BlockStore& store, uint32_t block, float min_weight) const {
  // Sides of the 9^3 voxels that are corners of the block's cells, z fastest.
  uint8_t side[kCorners][kCorners][kCorners];
  const BlockCoord& c = store[block].coord;
  for (int n = 0; n < 8; ++n) {
    const int dx = n >> 2, dy = n >> 1 & 1, dz = n & 1;
    const uint32_t from = n == 0 ? block : find({c.x + dx, c.y + dy, c.z + dz});
    for (int x = 0; x < (dx ? 1 : kBlockDim); ++x)
      for (int y = 0; y < (dy ? 1 : kBlockDim); ++y)
        for (int z = 0; z < (dz ? 1 : kBlockDim); ++z)
          side[dx * kBlockDim + x][dy * kBlockDim + y][dz * kBlockDim + z] =
              from == kNone ? kUnknown : side_of(*store[from].geometry, voxel_offset(x, y, z), min_weight);
  }
  BlockMask mask;
  for (int x = 0; x < kBlockDim; ++x)
    for (int y = 0; y < kBlockDim; ++y) {
      uint8_t edge[kCorners];
      for (int z = 0; z < kCorners; ++z)
        edge[z] = side[x][y][z] | side[x][y + 1][z] | side[x + 1][y][z] | side[x + 1][y + 1][z];
      for (int z = 0; z < kBlockDim; ++z)
        if ((edge[z] | edge[z + 1]) == (kFront | kBehind)) mask.set(voxel_offset(x, y, z));
    }
  return mask;
}

}  // namespace felt
