#include "mapping/labels/class_belief.h"

#include <algorithm>
#include <cmath>

namespace felt {
namespace {

/// Most probable class, its probability and the entropy of `alpha`.
ClassBelief belief_of(std::span<const double> alpha, bool with_entropy) {
  double total = 0;
  for (const double a : alpha) total += a;
  const auto most = std::max_element(alpha.begin(), alpha.end());
  double entropy = 0;
  if (with_entropy)
    for (const double a : alpha) entropy -= a / total * std::log(a / total);
  return {uint16_t(most - alpha.begin()), float(*most / total), float(entropy)};
}

}  // namespace

const Plane* evidence_counts(const Block& block, int slot) {
  const auto plane = std::find_if(block.evidence.begin(), block.evidence.end(),
                                  [slot](const EvidencePlane& p) { return p.slot == slot; });
  return plane == block.evidence.end() ? nullptr : plane->counts;
}

void class_concentration(const Block* block, int offset, const ClassTable& classes, std::span<double> alpha) {
  for (int slot = 0; slot < classes.size(); ++slot) alpha[size_t(slot)] = classes.prior(slot);
  if (block == nullptr) return;
  if (block->even_evidence != nullptr)
    if (const double share = double(block->even_evidence->value[offset]) / classes.size(); share > 0)
      for (double& a : alpha) a += share;
  for (const EvidencePlane& plane : block->evidence) alpha[plane.slot] += double(plane.counts->value[offset]);
}

ClassBelief class_belief(const Block& block, int offset, const ClassTable& classes, bool with_entropy) {
  const int k = classes.size();
  double most = 0, counts = 0;
  ClassBelief belief;
  for (const EvidencePlane& plane : block.evidence) {
    const double count = plane.counts->value[offset];
    counts += count;
    if (count > most) most = count, belief.slot = plane.slot;
  }
  if (k == 0 || most <= 0) return belief;
  if (!classes.even_prior()) {
    std::vector<double> alpha(static_cast<size_t>(k));
    class_concentration(&block, offset, classes, alpha);
    return belief_of(alpha, with_entropy);
  }
  // Classes without a plane all have the same concentration: no vector of k numbers is needed.
  const double even = block.even_evidence != nullptr ? double(block.even_evidence->value[offset]) : 0;
  const double floor = classes.prior(0) + even / k, total = k * floor + counts;
  belief.probability = float((floor + most) / total);
  if (!with_entropy) return belief;
  double entropy = -double(k - int(block.evidence.size())) * (floor / total) * std::log(floor / total);
  for (const EvidencePlane& plane : block.evidence) {
    const double p = (floor + double(plane.counts->value[offset])) / total;
    entropy -= p * std::log(p);
  }
  belief.entropy = float(entropy);
  return belief;
}

float total_evidence(const Block& block, int offset) {
  float total = block.even_evidence != nullptr ? block.even_evidence->value[offset] : 0;
  for (const EvidencePlane& e : block.evidence) total += e.counts->value[offset];
  return total;
}

}  // namespace felt
