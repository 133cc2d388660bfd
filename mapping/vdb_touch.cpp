#include "mapping/vdb_touch.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "mapping/touch_view.h"

namespace felt {
namespace {

openvdb::Coord coord_of(const BlockCoord& block, int offset) {
  const Index3 f = first_voxel(block), v = voxel_of_offset(offset);
  return {f.x + v.x, f.y + v.y, f.z + v.z};
}

template <typename Grid>
typename Grid::Ptr new_grid(const Map& map, const std::string& name) {
  auto grid = Grid::create();
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel_size_m));
  return grid;
}

}  // namespace

std::string touch_region_name(const Touch& touch) { return "touch_region/" + id_text(touch.id); }

openvdb::MaskGrid::Ptr region_grid(const Map& map, const Region& region, const std::string& name) {
  auto grid = new_grid<openvdb::MaskGrid>(map, name);
  for (size_t b = 0; b < region.blocks(); ++b) {
    const Index3 f = first_voxel(region.coord[b]);
    auto* leaf = grid->tree().touchLeaf({f.x, f.y, f.z});
    openvdb::MaskTree::LeafNodeType::NodeMaskType bits;
    for (int x = 0; x < 8; ++x) bits.getWord<openvdb::Index64>(openvdb::Index(x)) = region.mask[b].word[size_t(x)];
    leaf->setValueMask(bits);
  }
  return grid;
}

Region region_of(const openvdb::MaskGrid& grid) {
  std::vector<std::pair<BlockCoord, BlockMask>> blocks;
  for (auto leaf = grid.tree().cbeginLeaf(); leaf; ++leaf) {
    const openvdb::Coord o = leaf->origin();
    BlockMask mask;
    for (int x = 0; x < 8; ++x)
      mask.word[size_t(x)] = leaf->getValueMask().getWord<openvdb::Index64>(openvdb::Index(x));
    if (mask.any()) blocks.emplace_back(block_of_voxel({o.x(), o.y(), o.z()}), mask);
  }
  std::sort(blocks.begin(), blocks.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  Region region;
  for (const auto& [coord, mask] : blocks) region.append(coord, mask);
  return region;
}

std::vector<openvdb::GridBase::Ptr> touch_grids(const Map& map) {
  std::vector<openvdb::GridBase::Ptr> grids;
  if (!map.touches.any_active()) return grids;
  for (int p = 0; p < map.properties.size(); ++p) {
    const std::string prefix = "touch/" + map.properties[p].name + "/";
    auto n = new_grid<openvdb::FloatGrid>(map, prefix + "n"), mean = new_grid<openvdb::FloatGrid>(map, prefix + "mean"),
         m2 = new_grid<openvdb::FloatGrid>(map, prefix + "m2");
    for (const uint32_t number : map.store.sorted()) {
      const Block& block = map.store[number];
      for (const TouchPlanes& planes : block.touch) {
        if (planes.property != p) continue;
        for (int i = 0; i < kBlockVoxels; ++i) {
          if (!(planes.n->value[i] > 0)) continue;
          const openvdb::Coord at = coord_of(block.coord, i);
          n->tree().setValueOn(at, planes.n->value[i]);
          mean->tree().setValueOn(at, planes.mean->value[i]);
          m2->tree().setValueOn(at, planes.m2->value[i]);
        }
      }
    }
    if (n->activeVoxelCount() > 0) grids.insert(grids.end(), {n, mean, m2});
  }
  const std::vector<TouchView> views = touch_views(map);
  Region touched;
  for (const TouchView& view : views) touched.append(view.coord, view.mask);
  grids.push_back(region_grid(map, touched, "touched"));
  for (size_t p = 0; p < size_t(map.properties.size()); ++p) {
    auto mean = new_grid<openvdb::FloatGrid>(map, map.properties[int(p)].name + "_mean"),
         sd = new_grid<openvdb::FloatGrid>(map, map.properties[int(p)].name + "_sd");
    for (const TouchView& view : views)
      for_each_bit(view.mask, [&](int i) {
        const openvdb::Coord at = coord_of(view.coord, i);
        if (std::isfinite(view.mean[p][size_t(i)])) mean->tree().setValueOn(at, view.mean[p][size_t(i)]);
        if (std::isfinite(view.sd[p][size_t(i)])) sd->tree().setValueOn(at, view.sd[p][size_t(i)]);
      });
    grids.insert(grids.end(), {mean, sd});
  }
  return grids;
}

}  // namespace felt
