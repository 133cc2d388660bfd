#include "mapping/grids/leaf_grid.h"

#include <array>
#include <utility>

namespace felt {
namespace {

openvdb::Coord first_coord(const BlockCoord& c) { return {c.x * 8, c.y * 8, c.z * 8}; }

template <typename Mask>
void set_words(Mask& to, const BlockMask& from) {
  for (size_t x = 0; x < from.word.size(); ++x) to.template getWord<openvdb::Index64>(openvdb::Index(x)) = from.word[x];
}

template <typename Value>
openvdb::GridBase::Ptr new_grid(const Leaves<Value>& leaves) {
  return StockGrid<Value>::type::create(leaves.background);
}
openvdb::GridBase::Ptr new_grid(const Region&) { return openvdb::MaskGrid::create(); }

template <typename Value>
void add_leaves(openvdb::GridBase& grid, const Leaves<Value>& leaves) {
  using Tree = typename StockGrid<Value>::type::TreeType;
  using Leaf = typename Tree::LeafNodeType;
  Tree& tree = static_cast<typename StockGrid<Value>::type&>(grid).tree();
  for (size_t i = 0; i < leaves.coords->size(); ++i) {
    auto leaf = std::make_unique<Leaf>(first_coord((*leaves.coords)[i]), leaves.background);
    const BlockMask active = leaves.fill(i, leaf->buffer().data());
    if (!leaves.keeps_empty && !active.any()) continue;
    auto mask = leaf->getValueMask();
    set_words(mask, active);
    leaf->setValueMask(mask);
    tree.addLeaf(leaf.release());
  }
}

void add_leaves(openvdb::GridBase& grid, const Region& region) {
  auto& tree = static_cast<openvdb::MaskGrid&>(grid).tree();
  for (size_t b = 0; b < region.blocks(); ++b) {
    openvdb::MaskTree::LeafNodeType::NodeMaskType bits;
    set_words(bits, region.mask[b]);
    tree.touchLeaf(first_coord(region.coord[b]))->setValueMask(bits);
  }
}

template <typename Value>
Leaves<Value> clipped_leaves(const Leaves<Value>& whole, const Region& region) {
  auto coords = std::make_shared<std::vector<BlockCoord>>();
  std::vector<std::pair<size_t, const BlockMask*>> kept;
  for (size_t i = 0; i < whole.coords->size(); ++i)
    if (const BlockMask* inside = region.find((*whole.coords)[i])) {
      coords->push_back((*whole.coords)[i]);
      kept.emplace_back(i, inside);
    }
  Leaves<Value> part;
  part.background = whole.background;
  part.coords = std::move(coords);
  part.fill = [whole, kept = std::move(kept)](size_t i, Value* values) {
    const auto& [source, inside] = kept[i];
    const BlockMask active = whole.fill(source, values) & *inside;
    for (int v = 0; v < kBlockVoxels; ++v)
      if (!inside->test(v)) values[v] = whole.background;
    return active;
  };
  return part;
}

Region clipped_leaves(const Region& whole, const Region& region) { return intersected(whole, region); }

}  // namespace

bool before_in_tree(const BlockCoord& a, const BlockCoord& b) {
  // Nodes below the root are 512 blocks wide and their children 16; children follow one another along z, then y.
  constexpr int kUpper = 9, kLower = 4;
  const auto key = [](const BlockCoord& c) {
    const auto digits = [&](int shift) { return std::array{c.x >> shift, c.y >> shift, c.z >> shift}; };
    return std::array{digits(kUpper), digits(kLower), digits(0)};
  };
  return key(a) < key(b);
}

openvdb::GridBase::Ptr stock_grid_without_leaves(const LeafGrid& grid) {
  const openvdb::GridBase::Ptr made = std::visit([](const auto& leaves) { return new_grid(leaves); }, grid.leaves);
  made->setName(grid.name);
  made->setTransform(openvdb::math::Transform::createLinearTransform(grid.voxel_size_m));
  if (grid.grid_class != openvdb::GRID_UNKNOWN) made->setGridClass(grid.grid_class);
  if (std::holds_alternative<Leaves<openvdb::Vec3s>>(grid.leaves)) made->setVectorType(openvdb::VEC_INVARIANT);
  return made;
}

openvdb::GridBase::Ptr stock_grid(const LeafGrid& grid) {
  openvdb::GridBase::Ptr made = stock_grid_without_leaves(grid);
  std::visit([&](const auto& leaves) { add_leaves(*made, leaves); }, grid.leaves);
  return made;
}

LeafGrid clipped(const LeafGrid& grid, const Region& region) {
  LeafGrid part = grid;
  std::visit([&](const auto& leaves) { part.leaves = clipped_leaves(leaves, region); }, grid.leaves);
  return part;
}

}  // namespace felt
