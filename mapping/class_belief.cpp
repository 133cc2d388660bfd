#include "mapping/class_belief.h"

#include <cmath>

namespace felt {

ClassBelief class_belief(const Block& block, int offset, int classes) {
  ClassBelief belief;
  double total = classes, most = 0;
  for (const EvidencePlane& plane : block.evidence) {
    const double count = plane.counts->value[offset];
    total += count;
    if (count > most) most = count, belief.slot = plane.slot;
  }
  if (classes == 0 || most <= 0) return belief;
  belief.probability = float((1 + most) / total);
  // Classes without a plane share the prior's single count.
  const double prior = 1 / total;
  double entropy = -double(classes - int(block.evidence.size())) * prior * std::log(prior);
  for (const EvidencePlane& plane : block.evidence) {
    const double p = (1 + plane.counts->value[offset]) / total;
    entropy -= p * std::log(p);
  }
  belief.entropy = float(entropy);
  return belief;
}

}  // namespace felt
