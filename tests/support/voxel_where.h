#pragma once

#include <stdexcept>
#include <utility>

#include "mapping/map.h"

namespace felt::test {

/// A voxel of a map that may be written to.
struct VoxelAt {
  Block& block;
  int offset;
};

/// The first voxel, in ascending order of blocks, of which `holds(block, offset)`; throws where there is none.
template <typename Holds>
VoxelAt voxel_where(Map& map, const Holds& holds) {
  for (const uint32_t number : map.store.sorted())
    for (int i = 0; i < kBlockVoxels; ++i)
      if (holds(std::as_const(map.store[number]), i)) return {map.store[number], i};
  throw std::runtime_error("the map has no voxel that is looked for");
}

/// The first voxel that holds every kind of value: colour, counts of a class, even evidence and votes for an instance.
inline VoxelAt voxel_with_everything(Map& map) {
  return voxel_where(map, [](const Block& block, int i) {
    return block.geometry->weight[i] > 0 && block.color != nullptr && block.color->count[i] > 0 &&
           !block.evidence.empty() && block.evidence[0].counts->value[i] > 0 && block.even_evidence != nullptr &&
           block.even_evidence->value[i] > 0 && block.instance != nullptr && block.instance->votes[i] > 0;
  });
}

}  // namespace felt::test
