#include "mapping/touch/touch_mixture.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "inference/batch/mixture.h"

namespace felt {
namespace {

bool is_mixture(const Touch& touch) { return !touch.undone && touch.request.model == TouchModel::mixture; }

/// Touched properties, ascending: a voxel that `material` touches of one and `mixture` touches of another cover has a
/// state in both.
std::vector<int> touched_properties(const Map& map) {
  std::vector<int> properties;
  for (const Touch& touch : map.touches.touches)
    if (!touch.undone) properties.push_back(*map.properties.index_of(touch.request.property));
  std::sort(properties.begin(), properties.end());
  properties.erase(std::unique(properties.begin(), properties.end()), properties.end());
  return properties;
}

/// Vision counts and priors: the state before any touch.
void start(const Map& map, MixtureBlock& block, const std::vector<int>& properties,
           const std::vector<std::vector<Nig>>& priors) {
  const size_t k = size_t(map.classes.size()), m = block.voxels;
  block.a.resize(k * m);
  for (size_t c = 0; c < k; ++c) std::fill_n(&block.a[c * m], m, float(map.classes.prior(int(c))));
  if (const Block* counted = map.store.get(block.coord)) {
    if (const Plane* even = counted->even_evidence)
      for (size_t c = 0; c < k; ++c) {
        float* a = &block.a[c * m];
        for_each_bit(block.mask, [&](int offset) { *a++ += even->value[offset] / float(k); });
      }
    for (const EvidencePlane& e : counted->evidence) {
      float* a = &block.a[e.slot * m];
      for_each_bit(block.mask, [&](int offset) { *a++ += e.counts->value[offset]; });
    }
  }
  for (const int p : properties) {
    MixtureBlock::Blocks& state = block.properties.emplace_back();
    state.property = p;
    state.tau.assign(k * m, 0.0f);
    state.kappa.resize(k * m);
    state.beta.resize(k * m);
    state.gamma.resize(k * m);
    for (size_t c = 0; c < k; ++c) {
      const Nig& prior = priors[size_t(p)][c];
      std::fill_n(&state.kappa[c * m], m, float(prior.kappa));
      std::fill_n(&state.beta[c * m], m, float(prior.beta));
      std::fill_n(&state.gamma[c * m], m, float(prior.gamma));
    }
  }
}

/// Voxels that `material` touches cover start from the moment-matched view of those.
void start_from_material(const Map& map, MixtureBlock& block, const std::vector<std::vector<Nig>>& priors) {
  const size_t k = size_t(map.classes.size()), m = block.voxels;
  Beliefs beliefs(map);
  size_t i = 0;
  for_each_bit(block.mask, [&](int offset) {
    std::vector<uint32_t> touches = covering_touches(map, voxel_at(block.coord, offset));
    if (beliefs.has_material(touches)) {
      std::vector<double> vision(k);
      for (size_t c = 0; c < k; ++c) vision[c] = double(block.a[c * m + i]);
      const MaterialState& material = beliefs.material(touches);
      std::erase_if(touches, [&](uint32_t t) { return is_mixture(map.touches.touches[t]); });
      Belief belief = beliefs.assemble(vision, &material, touches);
      apply_concentration_floor(belief.concentration);
      for (size_t c = 0; c < k; ++c) {
        block.a[c * m + i] = float(belief.concentration[c]);
        for (MixtureBlock::Blocks& state : block.properties) {
          const Nig& nig = belief.nig[size_t(state.property)][c];
          state.tau[c * m + i] = float(nig.tau - priors[size_t(state.property)][c].tau);
          state.kappa[c * m + i] = float(nig.kappa);
          state.beta[c * m + i] = float(nig.beta);
          state.gamma[c * m + i] = float(nig.gamma);
        }
      }
    }
    ++i;
  });
}

/// What one reading applies to in one block.
struct Work {
  std::vector<MixturePlanes> classes;
  std::vector<uint8_t> selected;  ///< empty: every voxel
};

Work work_of(MixtureBlock& block, int property, const BlockMask& covered, const std::vector<Nig>& priors) {
  Work work;
  const size_t m = block.voxels;
  const auto state = std::find_if(block.properties.begin(), block.properties.end(),
                                  [&](const MixtureBlock::Blocks& s) { return s.property == property; });
  for (size_t c = 0; c < priors.size(); ++c) {
    MixturePlanes& planes = work.classes.emplace_back();
    planes.a = &block.a[c * m];
    if (!has_prior(priors[c])) continue;
    planes.tau = &state->tau[c * m];
    planes.kappa = &state->kappa[c * m];
    planes.beta = &state->beta[c * m];
    planes.gamma = &state->gamma[c * m];
    planes.tau_origin = priors[c].tau;
  }
  if (!(block.mask - covered).any()) return work;
  for_each_bit(block.mask, [&](int offset) { work.selected.push_back(covered.test(offset)); });
  return work;
}

}  // namespace

Nig MixtureState::nig(const MixtureBlock& block, const MixtureBlock::Blocks& state, size_t slot, size_t voxel) const {
  const size_t at = slot * block.voxels + voxel;
  const Nig& prior = priors[size_t(state.property)][slot];
  if (!has_prior(prior)) return {};
  return {prior.tau + double(state.tau[at]), double(state.kappa[at]), double(state.beta[at]), double(state.gamma[at])};
}

MixtureState mixture_state(const Map& map, const Region& region) {
  MixtureState out;
  out.refused.assign(map.touches.touches.size(), 0);
  for (const Property& property : map.properties.properties()) out.priors.push_back(nig_priors(property, map.classes));
  if (std::none_of(map.touches.touches.begin(), map.touches.touches.end(), is_mixture)) return out;
  Region mixed, material;
  for (const Touch& touch : map.touches.touches) {
    if (touch.undone) continue;
    Region& of_model = is_mixture(touch) ? mixed : material;
    of_model = united(of_model, touch.region);
  }
  mixed = intersected(mixed, region);
  const std::vector<int> properties = touched_properties(map);
  out.blocks.resize(mixed.blocks());
  tbb::parallel_for(size_t(0), mixed.blocks(), [&](size_t b) {
    MixtureBlock& block = out.blocks[b];
    block.coord = mixed.coord[b];
    block.mask = mixed.mask[b];
    block.voxels = size_t(block.mask.count());
    start(map, block, properties, out.priors);
    if (material.find(block.coord) != nullptr) start_from_material(map, block, out.priors);
  });
  for (size_t t = 0; t < map.touches.touches.size(); ++t) {
    const Touch& touch = map.touches.touches[t];
    if (!is_mixture(touch)) continue;
    const int property = *map.properties.index_of(touch.request.property);
    std::vector<Work> works;
    std::vector<MixtureBatch> batches;
    works.reserve(out.blocks.size());
    for (MixtureBlock& block : out.blocks) {
      const BlockMask* covered = touch.region.find(block.coord);
      if (covered == nullptr || !(block.mask & *covered).any()) continue;
      works.push_back(work_of(block, property, *covered, out.priors[size_t(property)]));
      MixtureBatch& batch = batches.emplace_back();
      batch.n = block.voxels;
      batch.classes = works.back().classes;
      batch.selected = works.back().selected.empty() ? nullptr : works.back().selected.data();
    }
    out.refused[t] =
        update_mixture(batches, touch.request.value, touch.request.sigma, touch.request.projection).refused;
  }
  return out;
}

}  // namespace felt
