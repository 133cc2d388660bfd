#pragma once

#include "mapping/grids/leaf_grid.h"
#include "mapping/touch/property_view.h"

namespace felt {

/// What the map believes about classes as stock grids, active where there is evidence or a touch; in touched voxels the
/// belief after the touches. `touched`: touch_views(map). Background is what an untouched voxel without evidence holds.

/// `label`: class id (not slot) of the most probable class; background -1.
LeafGrid label_grid(const Map& map, const TouchViews& touched);
/// `label_prob`: its probability; background: the largest prior probability.
LeafGrid label_probability_grid(const Map& map, const TouchViews& touched);
/// `entropy` of the class probabilities, nats; background: that of the prior.
LeafGrid entropy_grid(const Map& map, const TouchViews& touched);
/// `evidence_total`: sum of all vision evidence, without the prior; background 0.
LeafGrid total_evidence_grid(const Map& map);

}  // namespace felt
