#include "mapping/touch/voxel_beliefs.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "inference/decision.h"
#include "inference/priors.h"
#include "mapping/labels/class_belief.h"

namespace felt {

VoxelBeliefs::VoxelBeliefs(const Map& map) : map_(map), touched_block_(map.store.size(), kUntouched) {
  Beliefs beliefs(map);
  priors_ = beliefs.priors();
  const auto number_of = [&](const BlockCoord& coord) -> std::array<uint32_t, kBlockVoxels>& {
    uint32_t& number = touched_block_[map_.store.find(coord)];
    if (number == kUntouched) {
      number = uint32_t(state_number_.size());
      state_number_.emplace_back().fill(kUntouched);
    }
    return state_number_[number];
  };
  // Touches that cover voxels of blocks which the map no longer has say nothing here.
  const auto for_each_block = [&](const Region& region, const auto& visit) {
    for (size_t b = 0; b < region.blocks(); ++b)
      if (const uint32_t block = map_.store.find(region.coord[b]); block != BlockStore::kNone)
        visit(block, number_of(region.coord[b]), region.mask[b]);
  };
  for (const TouchGroup& group : touch_groups(map)) {
    const MaterialState* material = beliefs.has_material(group.touches) ? &beliefs.material(group.touches) : nullptr;
    if (!any_mixture(map, group.touches)) {
      // Equally touched voxels of one material share one state.
      const auto number = uint32_t(states_.size());
      states_.push_back(
          {material->classes.p, beliefs.assemble(material->classes.p, material, group.touches).next_reading});
      for_each_block(group.region, [&](uint32_t, auto& numbers, const BlockMask& mask) {
        for_each_bit(mask, [&](int i) { numbers[size_t(i)] = number; });
      });
      continue;
    }
    std::vector<VoxelRef> voxels;
    const size_t first = states_.size();
    for_each_block(group.region, [&](uint32_t block, auto& numbers, const BlockMask& mask) {
      for_each_bit(mask, [&](int i) {
        numbers[size_t(i)] = uint32_t(first + voxels.size());
        voxels.push_back({block, uint16_t(i)});
      });
    });
    states_.resize(first + voxels.size());
    tbb::parallel_for(size_t(0), voxels.size(), [&](size_t i) {
      std::vector<double> alpha(size_t(map_.classes.size()));
      class_concentration(&map_.store[voxels[i].block], voxels[i].offset, map_.classes, alpha);
      Belief belief = beliefs.assemble(std::move(alpha), material, group.touches);
      states_[first + i] = {std::move(belief.class_probability), std::move(belief.next_reading)};
    });
  }
}

const VoxelBeliefs::State* VoxelBeliefs::state_of(const VoxelRef& voxel) const {
  const uint32_t block = touched_block_[voxel.block];
  if (block == kUntouched) return nullptr;
  const uint32_t number = state_number_[block][voxel.offset];
  return number == kUntouched ? nullptr : &states_[number];
}

void VoxelBeliefs::class_probability(const VoxelRef& voxel, std::span<double> p) const {
  if (const State* state = state_of(voxel)) {
    std::copy(state->class_probability.begin(), state->class_probability.end(), p.begin());
    return;
  }
  class_concentration(&map_.store[voxel.block], voxel.offset, map_.classes, p);
  double total = 0;
  for (const double a : p) total += a;
  for (double& a : p) a /= total;
}

int VoxelBeliefs::strongest_class(const VoxelRef& voxel) const {
  if (const State* state = state_of(voxel)) return most_probable_class(state->class_probability);
  const ClassBelief belief = class_belief(map_.store[voxel.block], voxel.offset, map_.classes);
  return belief.slot == ClassTable::kNoSlot ? -1 : int(belief.slot);
}

StudentTMixture VoxelBeliefs::next_reading(const VoxelRef& voxel, int property) const {
  if (const State* state = state_of(voxel)) return state->next_reading[size_t(property)];
  const std::vector<Nig>& prior = priors_[size_t(property)];
  if (std::none_of(prior.begin(), prior.end(), [](const Nig& nig) { return has_prior(nig); })) return {};
  std::vector<double> p(size_t(map_.classes.size()));
  class_probability(voxel, p);
  return predictive_mixture(p, prior);
}

}  // namespace felt
