#include "mapping/grids/vdb_classes.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "mapping/grids/leaf_mask.h"
#include "mapping/grids/vdb_state.h"
#include "mapping/labels/class_belief.h"

namespace felt {
namespace {

/// Observed blocks where `any(block)`.
template <typename Any>
BlockList blocks_where(const Map& map, const Any& any) {
  std::vector<uint32_t> blocks;
  for (uint32_t number = 0; number < map.store.size(); ++number)
    if (const Block& block = map.store[number]; any(block) && block.geometry->observed()) blocks.push_back(number);
  return block_list(map, std::move(blocks));
}

/// Vision's belief where there is evidence, the touches' where there are any.
template <typename Value, typename FromVision, typename FromTouch>
LeafGrid belief_grid(const Map& map, const char* name, Value background, const TouchViews& touched, bool with_entropy,
                     FromVision from_vision, FromTouch from_touch) {
  const BlockList list = blocks_where(
      map, [&](const Block& block) { return block.has_evidence() || view_of(*touched, block.coord) != nullptr; });
  Leaves<Value> leaves;
  leaves.background = background;
  leaves.coords = list.coords;
  leaves.fill = [&map, blocks = list.blocks, background, touched, with_entropy, from_vision, from_touch](
                    size_t n, Value* values) {
    const Block& block = map.store[(*blocks)[n]];
    const TouchView* view = view_of(*touched, block.coord);
    BlockMask active;
    std::fill_n(values, kBlockVoxels, background);
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (view != nullptr && view->mask.test(i)) {
        values[i] = from_touch(*view, size_t(i));
        active.set(i);
      } else if (const ClassBelief belief = class_belief(block, i, map.classes, with_entropy);
                 belief.slot != ClassTable::kNoSlot) {
        values[i] = from_vision(belief);
        active.set(i);
      }
    }
    return active;
  };
  return {.name = name, .voxel_size_m = map.voxel_size_m, .leaves = std::move(leaves)};
}

}  // namespace

LeafGrid label_grid(const Map& map, const TouchViews& touched) {
  return belief_grid<int32_t>(
      map, "label", -1, touched, /*with_entropy=*/false,
      [&map](const ClassBelief& b) { return int32_t(map.classes.at_slot(b.slot).id); },
      [&map](const TouchView& t, size_t i) {
        return t.label[i] < 0 ? int32_t(-1) : int32_t(map.classes.at_slot(t.label[i]).id);
      });
}

LeafGrid label_probability_grid(const Map& map, const TouchViews& touched) {
  double most = 0;
  for (int slot = 0; slot < map.classes.size(); ++slot) most = std::max(most, map.classes.prior(slot));
  return belief_grid<float>(
      map, "label_prob", float(most / map.classes.prior_total()), touched, /*with_entropy=*/false,
      [](const ClassBelief& b) { return b.probability; },
      [](const TouchView& t, size_t i) { return t.label_probability[i]; });
}

LeafGrid entropy_grid(const Map& map, const TouchViews& touched) {
  double prior = 0;
  for (int slot = 0; slot < map.classes.size(); ++slot) {
    const double p = map.classes.prior(slot) / map.classes.prior_total();
    prior -= p * std::log(p);
  }
  return belief_grid<float>(
      map, "entropy", float(prior), touched, /*with_entropy=*/true, [](const ClassBelief& b) { return b.entropy; },
      [](const TouchView& t, size_t i) { return t.entropy[i]; });
}

LeafGrid total_evidence_grid(const Map& map) {
  const BlockList list = blocks_where(map, [](const Block& block) { return block.has_evidence(); });
  Leaves<float> leaves;
  leaves.coords = list.coords;
  leaves.fill = [&map, blocks = list.blocks](size_t n, float* values) {
    const Block& block = map.store[(*blocks)[n]];
    for (int i = 0; i < kBlockVoxels; ++i) values[i] = total_evidence(block, i);
    return mask_where([values](int i) { return values[i] > 0; });
  };
  return {.name = "evidence_total", .voxel_size_m = map.voxel_size_m, .leaves = std::move(leaves)};
}

}  // namespace felt
