#pragma once

#include <vector>

#include "mapping/touch/touch_state.h"

namespace felt {

/// State of the voxels of one block under `mixture` touches: Dirichlet concentrations and the NIG blocks of the touched
/// properties, class by class (entry of class c, voxel i at [c * voxels + i]), in f32.
struct MixtureBlock {
  BlockCoord coord;
  BlockMask mask;
  size_t voxels = 0;
  std::vector<float> a;
  struct Blocks {
    int property = 0;
    std::vector<float> tau;  ///< less `MixtureState::tau_origin`
    std::vector<float> kappa, beta, gamma;
  };
  std::vector<Blocks> properties;
};

struct MixtureState {
  std::vector<MixtureBlock> blocks;      ///< in canonical order
  std::vector<std::vector<Nig>> priors;  ///< by property, slot; tau of a state is less the prior's
  std::vector<uint64_t> refused;         ///< by touch (place in the journal): voxels that kept their state

  /// State of one class of one voxel.
  Nig nig(const MixtureBlock& block, const MixtureBlock::Blocks& state, size_t slot, size_t voxel) const;
};

/// The state of every voxel of `region` that a `mixture` touch covers, each from its own vision counts, all readings in
/// canonical order: within f32 what `Beliefs::at` gives for each of these voxels alone. All blocks in one batch a
/// reading, in parallel; the result does not depend on the number of threads.
MixtureState mixture_state(const Map& map, const Region& region);

}  // namespace felt
