#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/class_table.h"
#include "mapping/store/block_store.h"

namespace felt {

/// What vision says about the class of one voxel: the Dirichlet's mean.
struct ClassBelief {
  uint16_t slot = ClassTable::kNoSlot;  ///< most probable class, the lowest slot of equals; kNoSlot without evidence
  float probability = 0;                ///< of that class
  float entropy = 0;                    ///< of the class probabilities, nats
};

/// What vision counted of one class in a block, above its prior; null where it was not seen there.
const Plane* evidence_counts(const Block& block, int slot);

/// alpha_i = prior_i + count_i + even / k of one voxel by slot (INFERENCE section 1), into k numbers. A null block
/// holds the prior.
void class_concentration(const Block* block, int offset, const ClassTable& classes, std::span<double> alpha);

/// `with_entropy`: otherwise that stays 0, which saves logarithms.
ClassBelief class_belief(const Block& block, int offset, const ClassTable& classes, bool with_entropy = true);

/// Sum of the evidence of one voxel, without the prior.
float total_evidence(const Block& block, int offset);

}  // namespace felt
