#pragma once

#include <array>
#include <span>
#include <vector>

#include "mapping/map.h"
#include "mapping/touch/touch_state.h"

namespace felt {

/// What the map believes of each voxel: vision counts and, where touches reach, the readings with them. Computed once,
/// for touched voxels only, of a map that does not change meanwhile; queries may run in parallel. Pictures and
/// evaluations need the f64 Student-t mixtures that it gives; for means and spreads of millions of voxels there are the
/// closed forms of TouchView and PropertyView.
class VoxelBeliefs {
public:
  explicit VoxelBeliefs(const Map& map);

  int classes() const { return map_.classes.size(); }
  /// Expected class probabilities by slot; `p` has room for all classes.
  void class_probability(const VoxelRef& voxel, std::span<double> p) const;
  /// Slot of the strongest class, the lowest of equals; -1 where there is neither evidence nor a touch.
  int strongest_class(const VoxelRef& voxel) const;
  /// The next reading of a property there; without components where no class has a prior.
  StudentTMixture next_reading(const VoxelRef& voxel, int property) const;

private:
  struct State {
    std::vector<double> class_probability;
    std::vector<StudentTMixture> next_reading;  ///< by property
  };
  static constexpr uint32_t kUntouched = 0xffffffff;

  const State* state_of(const VoxelRef& voxel) const;

  const Map& map_;
  std::vector<std::vector<Nig>> priors_;                          ///< by property, slot
  std::vector<uint32_t> touched_block_;                           ///< by block number, kUntouched for most
  std::vector<std::array<uint32_t, kBlockVoxels>> state_number_;  ///< by touched block
  std::vector<State> states_;
};

}  // namespace felt
