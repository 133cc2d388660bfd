#include "mapping/grids/vdb_touch.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "mapping/grids/leaf_mask.h"
#include "mapping/touch/touch_view.h"

namespace felt {
namespace {

/// Active where the region and a finite value are; `fill(b, values)` writes the values of the region's b-th block.
template <typename Fill>
LeafGrid float_grid(const Map& map, std::shared_ptr<const Region> region, std::string name, Fill fill) {
  Leaves<float> leaves;
  leaves.coords = LeafCoords(region, &region->coord);
  leaves.fill = [region, fill = std::move(fill)](size_t b, float* values) {
    std::fill_n(values, kBlockVoxels, 0.0f);
    fill(b, values);
    const BlockMask active = region->mask[b] & mask_where([values](int i) { return std::isfinite(values[i]); });
    for (int i = 0; i < kBlockVoxels; ++i)
      if (!active.test(i)) values[i] = 0;
    return active;
  };
  return {.name = std::move(name), .voxel_size_m = map.voxel_size_m, .leaves = std::move(leaves)};
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

/// Whole blocks with labels or touches.
Region known_blocks(const Map& map) {
  Region known;
  for (const uint32_t number : map.store.sorted())
    if (const Block& block = map.store[number]; block.has_evidence() || !block.touch.empty())
      known.append(block.coord, all_voxels());
  return known;
}

}  // namespace

std::string touch_region_name(const Touch& touch) { return "touch_region/" + id_text(touch.id); }

LeafGrid region_grid(const Map& map, Region region, const std::string& name) {
  return {.name = name, .voxel_size_m = map.voxel_size_m, .leaves = std::move(region)};
}

std::vector<LeafGrid> touch_grids(const Map& map, const TouchViews& touched) {
  std::vector<LeafGrid> grids;
  const bool labelled = std::any_of(map.store.blocks().begin(), map.store.blocks().end(),
                                    [](const Block& block) { return block.has_evidence(); });
  if (map.properties.empty() || !labelled) return grids;
  Region region;
  for (const TouchView& view : *touched) region.append(view.coord, view.mask);
  grids.push_back(region_grid(map, std::move(region), "touched"));
  const auto known = std::make_shared<const Region>(known_blocks(map));
  for (int p = 0; p < map.properties.size(); ++p) {
    const auto view = std::make_shared<const PropertyView>(map, p, touched);
    for (const bool sd : {false, true})
      grids.push_back(float_grid(map, known, map.properties[p].name + (sd ? "_sd" : "_mean"),
                                 [&map, known, view, sd](size_t b, float* values) {
                                   float other[kBlockVoxels];
                                   const Block& block = *map.store.get(known->coord[b]);
                                   sd ? view->copy(block, other, values) : view->copy(block, values, other);
                                 }));
  }
  if (touched->empty()) return grids;
  const auto blocks = std::make_shared<const TouchBlocks>(map);
  for (int p = 0; p < map.properties.size(); ++p) {
    const auto readings = std::make_shared<const Region>(touched_region(map, p));
    if (readings->empty()) continue;
    const std::string property = map.properties[p].name;
    for (const auto& [part, plane] :
         {std::pair("n", &TouchPlanes::n), {"mean", &TouchPlanes::mean}, {"m2", &TouchPlanes::m2}})
      grids.push_back(float_grid(map, readings, "touch/" + property + "/" + part,
                                 [&map, readings, p, plane = plane](size_t b, float* values) {
                                   for (const TouchPlanes& planes : map.store.get(readings->coord[b])->touch)
                                     if (planes.property == p)
                                       std::copy_n((planes.*plane)->value, kBlockVoxels, values);
                                 }));
    const std::vector<Nig> priors = nig_priors(map.properties[p], map.classes);
    for (int slot = 0; slot < map.classes.size(); ++slot) {
      if (!has_prior(priors[size_t(slot)])) continue;
      for (const auto& [part, number] :
           {std::pair("tau", &Nig::tau), {"kappa", &Nig::kappa}, {"beta", &Nig::beta}, {"gamma", &Nig::gamma}})
        grids.push_back(float_grid(map, readings,
                                   "property/" + property + "/" + map.classes.at_slot(slot).name + "/" + part,
                                   [readings, blocks, p, slot, number = number](size_t b, float* values) {
                                     blocks->copy(readings->coord[b], p, slot, number, values);
                                   }));
    }
  }
  return grids;
}

}  // namespace felt
