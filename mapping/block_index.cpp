#include "mapping/block_index.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace felt {

BlockIndex::BlockIndex(const BlockStore& store, float min_weight) {
  for (uint32_t i = 0; i < store.size(); ++i) {
    const BlockCoord& c = store[i].coord;
    low_ = i == 0 ? c : BlockCoord{std::min(low_.x, c.x), std::min(low_.y, c.y), std::min(low_.z, c.z)};
    high_ = i == 0 ? c : BlockCoord{std::max(high_.x, c.x), std::max(high_.y, c.y), std::max(high_.z, c.z)};
    const auto [found, is_new] = cells_.try_emplace(block_of_voxel(c), uint32_t(children_.size()));
    if (is_new) children_.emplace_back().fill(kNone);
    children_[found->second][size_t(offset_in_block(c))] = i;
  }
  std::vector<uint8_t> behind(store.size());
  tbb::parallel_for(size_t(0), store.size(), [&](size_t i) {
    const GeometryPlanes& planes = *store[uint32_t(i)].geometry;
    bool any = false;
    for (int v = 0; v < kBlockVoxels; ++v) any |= planes.tsdf[v] < 0 && planes.weight[v] >= min_weight;
    behind[i] = any;
  });
  near_surface_.resize(store.size());
  tbb::parallel_for(size_t(0), store.size(), [&](size_t i) {
    const BlockCoord& c = store[uint32_t(i)].coord;
    bool any = behind[i] != 0;
    for (int n = 0; n < 27 && !any; ++n) {
      const uint32_t j = find({c.x + n / 9 - 1, c.y + n / 3 % 3 - 1, c.z + n % 3 - 1});
      any = j != kNone && behind[j] != 0;
    }
    near_surface_[i] = any;
  });
}

}  // namespace felt
