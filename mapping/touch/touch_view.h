#pragma once

#include <array>
#include <vector>

#include "mapping/labels/class_belief.h"
#include "mapping/touch/touch_mixture.h"
#include "mapping/touch/touch_state.h"

namespace felt {

/// What viewers and planners see of one touched block: entries where `mask` is set. f32 means and spreads, as grids of
/// millions of voxels keep them; `VoxelBeliefs` has the distributions.
struct TouchView {
  BlockCoord coord;
  BlockMask mask;
  std::array<int16_t, kBlockVoxels> label;  ///< slot of the strongest class
  std::array<float, kBlockVoxels> label_probability;
  std::array<float, kBlockVoxels> entropy;                ///< of the class belief, nats
  std::vector<std::array<float, kBlockVoxels>> mean, sd;  ///< by property, of the next reading; NaN where not finite
};

/// Views of every touched block in canonical order.
std::vector<TouchView> touch_views(const Map& map);

/// The view of a block, or null where no touch reached it.
const TouchView* view_of(const std::vector<TouchView>& views, const BlockCoord& block);

/// What is believed of the class of a voxel, touches included; `touched`: the map's views.
ClassBelief class_belief_at(const Map& map, const std::vector<TouchView>& touched, const Index3& voxel);

/// The moment-matched Normal-Inverse-Gamma blocks of every touched voxel, computed once and read plane by plane.
class TouchBlocks {
public:
  explicit TouchBlocks(const Map& map);
  /// One number of a class's block for the touched voxels of a map block, into 512 floats; others are left alone.
  void copy(const BlockCoord& coord, int property, int slot, double Nig::*number, float* out) const;

private:
  struct Group {
    Region region;
    std::vector<std::vector<Nig>> nig;  ///< by property, slot
  };
  std::vector<Group> groups_;  ///< touched by `material` only
  MixtureState mixed_;
};

}  // namespace felt
