#pragma once

#include <vector>

#include "mapping/touch_state.h"

namespace felt {

/// State of the voxels of one block under `mixture` touches: Dirichlet concentrations and the NIG blocks of the touched
/// properties, class by class (entry of class c, voxel i at [c * voxels + i]).
struct MixtureBlock {
  BlockCoord coord;
  BlockMask mask;
  int voxels = 0;
  std::vector<float> a;
  struct Blocks {
    int property = 0;
    std::vector<float> tau, kappa, beta, gamma;  ///< kappa 0: a class without a prior
  };
  std::vector<Blocks> properties;
  uint64_t refused = 0;  ///< readings of voxels that kept their state
};

/// The state of every voxel of `region` that a `mixture` touch covers, each from its own vision counts, all readings in
/// canonical order: what `Beliefs::at` gives for each of these voxels alone. Blocks in canonical order, in parallel.
std::vector<MixtureBlock> mixture_state(const Map& map, const Region& region);

}  // namespace felt
