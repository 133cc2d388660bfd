#pragma once

#include <openvdb/openvdb.h>

#include <span>

#include "mapping/map.h"
#include "mapping/touch_view.h"

namespace felt {

/// What the map believes about classes as stock grids, active where there is evidence or a touch; in touched voxels the
/// belief after the touches. `touched`: touch_views(map). Background is what an untouched voxel without evidence holds.

/// `label`: class id (not slot) of the most probable class; background -1.
openvdb::Int32Grid::Ptr label_grid(const Map& map, std::span<const TouchView> touched);
/// `label_prob`: its probability; background: the largest prior probability.
openvdb::FloatGrid::Ptr label_probability_grid(const Map& map, std::span<const TouchView> touched);
/// `entropy` of the class probabilities, nats; background: that of the prior.
openvdb::FloatGrid::Ptr entropy_grid(const Map& map, std::span<const TouchView> touched);
/// `evidence_total`: sum of all vision evidence, without the prior; background 0.
openvdb::FloatGrid::Ptr total_evidence_grid(const Map& map);

/// `evidence_even`: the evidence that all classes share; null where no block has any. State.
openvdb::FloatGrid::Ptr even_evidence_grid(const Map& map);
/// `instance` and `instance_votes`: null where no block has any. State.
openvdb::Int32Grid::Ptr instance_grid(const Map& map);
openvdb::Int32Grid::Ptr instance_votes_grid(const Map& map);

}  // namespace felt
