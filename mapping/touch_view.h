#pragma once

#include <array>
#include <vector>

#include "mapping/touch_state.h"

namespace felt {

/// What viewers and planners see of one touched block: entries where `mask` is set.
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

/// Strongest class of every voxel of a region in canonical order, touched or not: -1 without evidence and touches.
struct TouchedLabels {
  std::vector<int16_t> label;
  std::vector<uint64_t> refused;  ///< by touch (place in the journal): voxels whose state it left as it was
};
TouchedLabels touched_labels(const Map& map, const Region& region);

}  // namespace felt
