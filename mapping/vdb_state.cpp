#include "mapping/vdb_state.h"

#include <algorithm>

#include "mapping/leaf_mask.h"

namespace felt {
namespace {

openvdb::Coord first_coord(const BlockCoord& c) { return {c.x * 8, c.y * 8, c.z * 8}; }

/// Grid without background surprises: a leaf for each of `blocks`, active where the value is not zero.
template <typename Grid, typename Write>
typename Grid::Ptr state_grid(const Map& map, const std::string& name, const std::vector<uint32_t>& blocks,
                              Write write) {
  openvdb::initialize();
  auto grid = Grid::create(typename Grid::ValueType(0));
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel_size_m));
  using Leaf = typename Grid::TreeType::LeafNodeType;
  openvdb::tree::ValueAccessor<typename Grid::TreeType> accessor(grid->tree());
  for (const uint32_t number : blocks) {
    const Block& block = map.store[number];
    auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), first_coord(block.coord));
    typename Grid::ValueType* out = leaf->buffer().data();
    write(block, out);
    set_active(*leaf, [out](int i) { return out[i] != 0; });
    accessor.addLeaf(leaf.release());
  }
  return grid;
}

}  // namespace

BlockLists block_lists(const Map& map) {
  BlockLists lists;
  lists.evidence.resize(size_t(map.classes.size()));
  for (const uint32_t number : map.store.sorted()) {
    const Block& block = map.store[number];
    if (!block.geometry->observed()) continue;
    if (block.color != nullptr) lists.color.push_back(number);
    for (const EvidencePlane& plane : block.evidence) lists.evidence.at(plane.slot).push_back(number);
  }
  return lists;
}

openvdb::Int32Grid::Ptr color_count_grid(const Map& map, const std::vector<uint32_t>& blocks) {
  return state_grid<openvdb::Int32Grid>(map, "color_count", blocks, [](const Block& block, int32_t* out) {
    std::copy_n(block.color->count, kBlockVoxels, out);
  });
}

std::string evidence_name(const Map& map, int slot) { return "evidence/" + map.classes.at_slot(slot).name; }

openvdb::FloatGrid::Ptr evidence_grid(const Map& map, int slot, const std::vector<uint32_t>& blocks) {
  return state_grid<openvdb::FloatGrid>(map, evidence_name(map, slot), blocks, [slot](const Block& block, float* out) {
    const auto plane = std::find_if(block.evidence.begin(), block.evidence.end(),
                                    [slot](const EvidencePlane& p) { return p.slot == slot; });
    std::copy_n(plane->counts->value, kBlockVoxels, out);
  });
}

}  // namespace felt
