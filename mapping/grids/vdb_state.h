#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "mapping/grids/leaf_grid.h"

namespace felt {

/// The state of a map as stock OpenVDB grids: everything that a map is loaded from but tables and journals. A plane in
/// memory is a leaf in the grid, and the other way round: what is absent stays absent.

/// Blocks that have a plane of one kind, in the order of a tree.
struct BlockList {
  std::shared_ptr<const std::vector<uint32_t>> blocks;  ///< numbers in the map's store
  LeafCoords coords;

  bool empty() const { return blocks->empty(); }
};

/// Which blocks have what, found once for all grids of a map. Blocks that were never observed have nothing.
struct BlockLists {
  BlockList observed, color, even_evidence, instance;
  std::vector<BlockList> evidence;  ///< by slot
};
BlockLists block_lists(const Map& map);
/// The blocks of these numbers, in the order of a tree.
BlockList block_list(const Map& map, std::vector<uint32_t> blocks);

/// `tsdf` is a level set in metres with background = truncation. Voxels of `tsdf`, `weight` and `color` (in [0, 1], its
/// 16 bits survive the trip through float) are active where weight > 0; all three have the same topology. Those of the
/// other grids are active where the value is not 0. `list`: the blocks that have what the grid shows.
LeafGrid tsdf_grid(const Map& map, const BlockList& observed);
LeafGrid weight_grid(const Map& map, const BlockList& observed);
LeafGrid color_grid(const Map& map, const BlockList& observed);
/// `color_count`: observations of the colour average.
LeafGrid color_count_grid(const Map& map, const BlockList& list);
/// "evidence/<class>"
std::string evidence_name(const Map& map, int slot);
/// Evidence of one class above its prior.
LeafGrid evidence_grid(const Map& map, int slot, const BlockList& list);
/// `evidence_even`: the evidence that all classes share.
LeafGrid even_evidence_grid(const Map& map, const BlockList& list);
LeafGrid instance_grid(const Map& map, const BlockList& list);
LeafGrid instance_votes_grid(const Map& map, const BlockList& list);

}  // namespace felt
