#include "mapping/touch/touch_view.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "inference/decision.h"
#include "inference/priors.h"

namespace felt {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// The numbers of one voxel's view.
struct Cell {
  int16_t label = -1;
  float label_probability = 0, entropy = 0;
  std::vector<float> mean, sd;
};

Cell cell_of(const std::vector<double>& p, const std::vector<StudentTMixture>& next) {
  Cell cell;
  cell.label = int16_t(most_probable_class(p));
  cell.label_probability = float(p[size_t(cell.label)]);
  cell.entropy = float(class_entropy(p));
  for (const StudentTMixture& m : next) {
    cell.mean.push_back(float(m.weight.empty() ? kNone : mean(m).value_or(kNone)));
    cell.sd.push_back(float(m.weight.empty() ? kNone : std::sqrt(variance(m).value_or(kNone))));
  }
  return cell;
}

/// Belief of one voxel of a mixture block.
Belief belief_of(const MixtureState& state, const MixtureBlock& block, size_t i) {
  const size_t m = block.voxels, k = block.a.size() / m;
  Belief belief;
  double total = 0;
  for (size_t c = 0; c < k; ++c) belief.class_probability.push_back(double(block.a[c * m + i]));
  for (const double a : belief.class_probability) total += a;
  for (double& p : belief.class_probability) p /= total;
  belief.nig = state.priors;
  for (const MixtureBlock::Blocks& blocks : block.properties)
    for (size_t c = 0; c < k; ++c) belief.nig[size_t(blocks.property)][c] = state.nig(block, blocks, c, i);
  for (const std::vector<Nig>& nig : belief.nig) {
    double mass = 0;
    for (size_t c = 0; c < k; ++c) mass += has_prior(nig[c]) ? belief.class_probability[c] : 0;
    belief.next_reading.push_back(mass > 0 ? predictive_mixture(belief.class_probability, nig) : StudentTMixture{});
  }
  return belief;
}

/// Whether a property of the group has `material` readings and no `mixture` ones.
bool any_material_only(const Map& map, const TouchGroup& group) {
  const auto has = [&](const std::string& property, TouchModel model) {
    return std::any_of(group.touches.begin(), group.touches.end(), [&](uint32_t t) {
      const TouchRequest& r = map.touches.touches[t].request;
      return r.property == property && r.model == model;
    });
  };
  return std::any_of(map.properties.properties().begin(), map.properties.properties().end(), [&](const Property& p) {
    return has(p.name, TouchModel::material) && !has(p.name, TouchModel::mixture);
  });
}

}  // namespace

const TouchView* view_of(const std::vector<TouchView>& views, const BlockCoord& block) {
  const auto at = std::lower_bound(views.begin(), views.end(), block,
                                   [](const TouchView& view, const BlockCoord& c) { return view.coord < c; });
  return at != views.end() && at->coord == block ? &*at : nullptr;
}

ClassBelief class_belief_at(const Map& map, const std::vector<TouchView>& touched, const Index3& voxel) {
  const BlockCoord coord = block_of_voxel(voxel);
  const int i = offset_in_block(voxel);
  if (const TouchView* view = view_of(touched, coord); view != nullptr && view->mask.test(i))
    return {uint16_t(view->label[size_t(i)]), view->label_probability[size_t(i)], view->entropy[size_t(i)]};
  const Block* block = map.store.get(coord);
  return block == nullptr ? ClassBelief{} : class_belief(*block, i, map.classes);
}

TouchBlocks::TouchBlocks(const Map& map) {
  Beliefs beliefs(map);
  Region touched;
  for (TouchGroup& group : touch_groups(map)) {
    touched = united(touched, group.region);
    if (any_mixture(map, group.touches)) continue;
    const MaterialState& state = beliefs.material(group.touches);
    groups_.push_back({std::move(group.region), beliefs.assemble(state.classes.p, &state, group.touches).nig});
  }
  mixed_ = mixture_state(map, touched);
}

void TouchBlocks::copy(const BlockCoord& coord, int property, int slot, double Nig::*number, float* out) const {
  for (const Group& group : groups_)
    if (const BlockMask* bits = group.region.find(coord)) {
      const auto value = float(group.nig[size_t(property)][size_t(slot)].*number);
      for_each_bit(*bits, [&](int i) { out[i] = value; });
    }
  const auto block = std::lower_bound(mixed_.blocks.begin(), mixed_.blocks.end(), coord,
                                      [](const MixtureBlock& b, const BlockCoord& c) { return b.coord < c; });
  if (block == mixed_.blocks.end() || !(block->coord == coord)) return;
  for (const MixtureBlock::Blocks& state : block->properties) {
    if (state.property != property) continue;
    size_t i = 0;
    for_each_bit(block->mask,
                 [&](int offset) { out[offset] = float(mixed_.nig(*block, state, size_t(slot), i++).*number); });
  }
}

std::vector<TouchView> touch_views(const Map& map) {
  Region touched;
  const std::vector<TouchGroup> groups = touch_groups(map);
  for (const TouchGroup& group : groups) touched = united(touched, group.region);
  const size_t properties = size_t(map.properties.size());
  std::vector<TouchView> views(touched.blocks());
  for (size_t b = 0; b < views.size(); ++b) {
    views[b].coord = touched.coord[b];
    views[b].mask = touched.mask[b];
    views[b].mean.resize(properties);
    views[b].sd.resize(properties);
  }
  const auto view_of = [&](const BlockCoord& coord) -> TouchView& {
    return views[size_t(touched.find(coord) - touched.mask.data())];
  };
  const auto put = [&](TouchView& view, int i, const Cell& cell) {
    view.label[size_t(i)] = cell.label;
    view.label_probability[size_t(i)] = cell.label_probability;
    view.entropy[size_t(i)] = cell.entropy;
    for (size_t p = 0; p < properties; ++p) {
      view.mean[p][size_t(i)] = cell.mean[p];
      view.sd[p][size_t(i)] = cell.sd[p];
    }
  };
  Beliefs beliefs(map);
  for (const TouchGroup& group : groups) {
    if (any_mixture(map, group.touches)) continue;
    const MaterialState& state = beliefs.material(group.touches);
    const Belief belief = beliefs.assemble(state.classes.p, &state, group.touches);
    const Cell cell = cell_of(state.classes.p, belief.next_reading);
    for (size_t b = 0; b < group.region.blocks(); ++b) {
      TouchView& view = view_of(group.region.coord[b]);
      for_each_bit(group.region.mask[b], [&](int i) { put(view, i, cell); });
    }
  }
  // A property with `material` readings only keeps its predictive of this very region, which no moments hold: the
  // voxels that another property's `mixture` touches cover as well are answered one by one.
  Region apart;
  for (const TouchGroup& group : groups)
    if (any_mixture(map, group.touches) && any_material_only(map, group)) apart = united(apart, group.region);
  for (size_t b = 0; b < apart.blocks(); ++b) {
    TouchView& view = view_of(apart.coord[b]);
    for_each_bit(apart.mask[b], [&](int i) {
      const Belief belief = beliefs.at(voxel_at(apart.coord[b], i));
      put(view, i, cell_of(belief.class_probability, belief.next_reading));
    });
  }
  const MixtureState mixed = mixture_state(map, subtracted(touched, apart));
  tbb::parallel_for(size_t(0), mixed.blocks.size(), [&](size_t b) {
    const MixtureBlock& block = mixed.blocks[b];
    TouchView& view = view_of(block.coord);
    size_t i = 0;
    for_each_bit(block.mask, [&](int offset) {
      const Belief belief = belief_of(mixed, block, i++);
      put(view, offset, cell_of(belief.class_probability, belief.next_reading));
    });
  });
  return views;
}

}  // namespace felt
