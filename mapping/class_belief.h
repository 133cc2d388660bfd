#pragma once

#include <cstdint>

#include "core/class_table.h"
#include "mapping/block_store.h"

namespace felt {

/// What vision says about the class of one voxel: the Dirichlet's mean with one prior count a class.
struct ClassBelief {
  uint16_t slot = ClassTable::kNoSlot;  ///< most probable class, the lowest slot of equals; kNoSlot without evidence
  float probability = 0;                ///< of that class
  float entropy = 0;                    ///< of the class probabilities, nats
};

/// `classes`: k. Counts are above the prior, alpha_i = 1 + count_i.
ClassBelief class_belief(const Block& block, int offset, int classes);

}  // namespace felt
