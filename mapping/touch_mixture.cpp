#include "mapping/touch_mixture.h"

#include <tbb/parallel_for.h>

#include <algorithm>

namespace felt {
namespace {

/// Properties with an active `mixture` touch, ascending.
std::vector<int> mixed_properties(const Map& map) {
  std::vector<int> properties;
  for (const Touch& touch : map.touches.touches)
    if (!touch.undone && touch.request.model == TouchModel::mixture)
      properties.push_back(*map.properties.index_of(touch.request.property));
  std::sort(properties.begin(), properties.end());
  properties.erase(std::unique(properties.begin(), properties.end()), properties.end());
  return properties;
}

}  // namespace

std::vector<MixtureBlock> mixture_state(const Map& map, const Region& region) {
  Region mixed;
  for (const Touch& touch : map.touches.touches)
    if (!touch.undone && touch.request.model == TouchModel::mixture) mixed = united(mixed, touch.region);
  mixed = intersected(mixed, region);
  const std::vector<int> properties = mixed_properties(map);
  const size_t k = size_t(map.classes.size());
  std::vector<MixtureBlock> blocks(mixed.blocks());
  tbb::parallel_for(size_t(0), mixed.blocks(), [&](size_t b) {
    MixtureBlock& out = blocks[b];
    out.coord = mixed.coord[b];
    out.mask = mixed.mask[b];
    out.voxels = out.mask.count();
    const size_t m = size_t(out.voxels);
    out.a.resize(k * m);
    for (const int p : properties)
      out.properties.push_back({p, std::vector<float>(k * m), std::vector<float>(k * m), std::vector<float>(k * m),
                                std::vector<float>(k * m)});
    Beliefs beliefs(map);
    const Index3 f = first_voxel(out.coord);
    size_t i = 0;
    for_each_bit(out.mask, [&](int offset) {
      const Index3 v = voxel_of_offset(offset);
      const Belief belief = beliefs.at({f.x + v.x, f.y + v.y, f.z + v.z});
      out.refused += belief.refused;
      for (size_t c = 0; c < k; ++c) {
        out.a[c * m + i] = float(belief.concentration[c]);
        for (MixtureBlock::Blocks& state : out.properties) {
          const Nig& nig = belief.nig[size_t(state.property)][c];
          state.tau[c * m + i] = float(nig.tau);
          state.kappa[c * m + i] = float(nig.kappa);
          state.beta[c * m + i] = float(nig.beta);
          state.gamma[c * m + i] = float(nig.gamma);
        }
      }
      ++i;
    });
  });
  return blocks;
}

}  // namespace felt
