#include "mapping/vdb_classes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "mapping/class_belief.h"
#include "mapping/leaf_mask.h"

namespace felt {
namespace {

openvdb::Coord first_coord(const BlockCoord& c) { return {c.x * 8, c.y * 8, c.z * 8}; }

/// A leaf for each block where `fill(block, values, active)` says that any voxel is active.
template <typename Grid, typename Fill>
typename Grid::Ptr make_grid(const Map& map, const char* name, typename Grid::ValueType background, Fill fill) {
  openvdb::initialize();
  auto grid = Grid::create(background);
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel_size_m));
  using Leaf = typename Grid::TreeType::LeafNodeType;
  const std::vector<uint32_t> order = map.store.sorted();
  std::vector<std::unique_ptr<Leaf>> leaves(order.size());
  tbb::parallel_for(size_t(0), order.size(), [&](size_t n) {
    const Block& block = map.store[order[n]];
    if (!block.geometry->observed()) return;
    auto leaf = std::make_unique<Leaf>(first_coord(block.coord), background);
    BlockMask active;
    fill(block, leaf->buffer().data(), active);
    if (!active.any()) return;
    set_active(*leaf, [&](int i) { return active.test(i); });
    leaves[n] = std::move(leaf);
  });
  for (std::unique_ptr<Leaf>& leaf : leaves)
    if (leaf != nullptr) grid->tree().addLeaf(leaf.release());
  return grid;
}

/// Vision's belief where there is evidence, the touches' where there are any.
template <typename Grid, typename FromVision, typename FromTouch>
typename Grid::Ptr belief_grid(const Map& map, const char* name, typename Grid::ValueType background,
                               std::span<const TouchView> touched, FromVision from_vision, FromTouch from_touch) {
  return make_grid<Grid>(
      map, name, background, [&](const Block& block, typename Grid::ValueType* out, BlockMask& active) {
        const auto view = std::lower_bound(touched.begin(), touched.end(), block.coord,
                                           [](const TouchView& t, const BlockCoord& coord) { return t.coord < coord; });
        const bool any_touch = view != touched.end() && view->coord == block.coord;
        if (!any_touch && !block.has_evidence()) return;
        for (int i = 0; i < kBlockVoxels; ++i) {
          if (any_touch && view->mask.test(i)) {
            out[i] = from_touch(*view, size_t(i));
            active.set(i);
          } else if (const ClassBelief belief = class_belief(block, i, map.classes);
                     belief.slot != ClassTable::kNoSlot) {
            out[i] = from_vision(belief);
            active.set(i);
          }
        }
      });
}

/// A plane as it is: a leaf for each plane, also where it holds zeros only, active where it does not.
template <typename Grid, typename Values>
typename Grid::Ptr plane_grid(const Map& map, const char* name, Values values_of) {
  openvdb::initialize();
  auto grid = Grid::create(typename Grid::ValueType(0));
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel_size_m));
  using Leaf = typename Grid::TreeType::LeafNodeType;
  for (const uint32_t number : map.store.sorted()) {
    const Block& block = map.store[number];
    const auto* values = block.geometry->observed() ? values_of(block) : nullptr;
    if (values == nullptr) continue;
    auto leaf = std::make_unique<Leaf>(first_coord(block.coord));
    std::copy_n(values, kBlockVoxels, leaf->buffer().data());
    set_active(*leaf, [values](int i) { return values[i] != 0; });
    grid->tree().addLeaf(leaf.release());
  }
  return grid->tree().leafCount() == 0 ? nullptr : grid;
}

}  // namespace

openvdb::Int32Grid::Ptr label_grid(const Map& map, std::span<const TouchView> touched) {
  return belief_grid<openvdb::Int32Grid>(
      map, "label", -1, touched, [&](const ClassBelief& b) { return int32_t(map.classes.at_slot(b.slot).id); },
      [&](const TouchView& t, size_t i) {
        return t.label[i] < 0 ? int32_t(-1) : int32_t(map.classes.at_slot(t.label[i]).id);
      });
}

openvdb::FloatGrid::Ptr label_probability_grid(const Map& map, std::span<const TouchView> touched) {
  double most = 0;
  for (int slot = 0; slot < map.classes.size(); ++slot) most = std::max(most, map.classes.prior(slot));
  return belief_grid<openvdb::FloatGrid>(
      map, "label_prob", float(most / map.classes.prior_total()), touched,
      [](const ClassBelief& b) { return b.probability; },
      [](const TouchView& t, size_t i) { return t.label_probability[i]; });
}

openvdb::FloatGrid::Ptr entropy_grid(const Map& map, std::span<const TouchView> touched) {
  double prior = 0;
  for (int slot = 0; slot < map.classes.size(); ++slot) {
    const double p = map.classes.prior(slot) / map.classes.prior_total();
    prior -= p * std::log(p);
  }
  return belief_grid<openvdb::FloatGrid>(
      map, "entropy", float(prior), touched, [](const ClassBelief& b) { return b.entropy; },
      [](const TouchView& t, size_t i) { return t.entropy[i]; });
}

openvdb::FloatGrid::Ptr total_evidence_grid(const Map& map) {
  return make_grid<openvdb::FloatGrid>(map, "evidence_total", 0, [](const Block& block, float* out, BlockMask& active) {
    if (!block.has_evidence()) return;
    for (int i = 0; i < kBlockVoxels; ++i)
      if ((out[i] = total_evidence(block, i)) > 0) active.set(i);
  });
}

openvdb::FloatGrid::Ptr even_evidence_grid(const Map& map) {
  return plane_grid<openvdb::FloatGrid>(map, "evidence_even", [](const Block& block) -> const float* {
    return block.even_evidence == nullptr ? nullptr : block.even_evidence->value;
  });
}

openvdb::Int32Grid::Ptr instance_grid(const Map& map) {
  return plane_grid<openvdb::Int32Grid>(map, "instance", [](const Block& block) -> const uint16_t* {
    return block.instance == nullptr ? nullptr : block.instance->id;
  });
}

openvdb::Int32Grid::Ptr instance_votes_grid(const Map& map) {
  return plane_grid<openvdb::Int32Grid>(map, "instance_votes", [](const Block& block) -> const uint16_t* {
    return block.instance == nullptr ? nullptr : block.instance->votes;
  });
}

}  // namespace felt
