#include "mapping/vdb_touch.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "mapping/leaf_mask.h"
#include "mapping/touch_view.h"

namespace felt {
namespace {

template <typename Grid>
typename Grid::Ptr new_grid(const Map& map, const std::string& name) {
  auto grid = Grid::create();
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel_size_m));
  return grid;
}

openvdb::Coord first_coord(const BlockCoord& c) { return {c.x * 8, c.y * 8, c.z * 8}; }

/// A leaf for each block of the region, active where the region and a finite value are; `fill(b, out)` writes the
/// values of its b-th block.
template <typename Fill>
openvdb::FloatGrid::Ptr float_grid(const Map& map, const Region& region, const std::string& name, const Fill& fill) {
  auto grid = new_grid<openvdb::FloatGrid>(map, name);
  for (size_t b = 0; b < region.blocks(); ++b) {
    auto leaf = std::make_unique<openvdb::FloatTree::LeafNodeType>(first_coord(region.coord[b]), 0.0f);
    float* values = leaf->buffer().data();
    fill(b, values);
    set_active(*leaf, [&](int i) { return region.mask[b].test(i) && std::isfinite(values[i]); });
    for (int i = 0; i < kBlockVoxels; ++i)
      if (!leaf->isValueOn(openvdb::Index(i))) values[i] = 0;
    if (!leaf->isEmpty()) grid->tree().addLeaf(leaf.release());
  }
  return grid;
}

BlockMask all_voxels() {
  BlockMask mask;
  mask.word.fill(~uint64_t(0));
  return mask;
}

/// Voxels that readings of a property cover.
Region touched_region(const Map& map, int property) {
  Region region;
  for (const uint32_t number : map.store.sorted())
    for (const TouchPlanes& planes : map.store[number].touch) {
      if (planes.property != property) continue;
      BlockMask bits;
      for (int i = 0; i < kBlockVoxels; ++i)
        if (planes.n->value[i] > 0) bits.set(i);
      if (bits.any()) region.append(map.store[number].coord, bits);
    }
  return region;
}

/// `<property>_mean` or `<property>_sd`, active where it exists.
openvdb::FloatGrid::Ptr property_grid(const Map& map, const PropertyView& view, const std::string& name, bool sd) {
  Region known;
  for (const uint32_t number : map.store.sorted())
    if (const Block& block = map.store[number]; block.has_evidence() || !block.touch.empty())
      known.append(block.coord, all_voxels());
  return float_grid(map, known, name, [&](size_t b, float* out) {
    float other[kBlockVoxels];
    const Block& block = *map.store.get(known.coord[b]);
    sd ? view.copy(block, other, out) : view.copy(block, out, other);
  });
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

std::vector<NamedGrid> touch_grids(const Map& map, TouchViews touched) {
  std::vector<NamedGrid> grids;
  const bool labelled = std::any_of(map.store.blocks().begin(), map.store.blocks().end(),
                                    [](const Block& block) { return block.has_evidence(); });
  if (map.properties.empty() || !labelled) return grids;
  const auto add = [&](const std::string& name, auto make) {
    grids.push_back({name, [name, make] { return make(name); }});
  };
  add("touched", [&map, touched](const std::string& name) {
    Region region;
    for (const TouchView& view : *touched) region.append(view.coord, view.mask);
    return region_grid(map, region, name);
  });
  for (int p = 0; p < map.properties.size(); ++p)
    for (const bool sd : {false, true})
      add(map.properties[p].name + (sd ? "_sd" : "_mean"), [&map, touched, p, sd](const std::string& name) {
        return property_grid(map, PropertyView(map, p, touched), name, sd);
      });
  if (touched->empty()) return grids;
  const auto blocks = std::make_shared<const TouchBlocks>(map);
  for (int p = 0; p < map.properties.size(); ++p) {
    const auto readings = std::make_shared<const Region>(touched_region(map, p));
    if (readings->empty()) continue;
    const std::string property = map.properties[p].name;
    for (const auto& [part, plane] :
         {std::pair("n", &TouchPlanes::n), {"mean", &TouchPlanes::mean}, {"m2", &TouchPlanes::m2}})
      add("touch/" + property + "/" + part, [&map, readings, p, plane = plane](const std::string& name) {
        return float_grid(map, *readings, name, [&](size_t b, float* out) {
          for (const TouchPlanes& planes : map.store.get(readings->coord[b])->touch)
            if (planes.property == p) std::copy_n((planes.*plane)->value, kBlockVoxels, out);
        });
      });
    const std::vector<Nig> priors = nig_priors(map.properties[p], map.classes);
    for (int slot = 0; slot < map.classes.size(); ++slot) {
      if (!has_prior(priors[size_t(slot)])) continue;
      for (const auto& [part, number] :
           {std::pair("tau", &Nig::tau), {"kappa", &Nig::kappa}, {"beta", &Nig::beta}, {"gamma", &Nig::gamma}})
        add("property/" + property + "/" + map.classes.at_slot(slot).name + "/" + part,
            [&map, readings, blocks, p, slot, number = number](const std::string& name) {
              return float_grid(map, *readings, name,
                                [&](size_t b, float* out) { blocks->copy(readings->coord[b], p, slot, number, out); });
            });
    }
  }
  return grids;
}

}  // namespace felt
