#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace felt {

/// What one pixel labelled with a class says, as evidence that sums to 1: the share of every class it speaks for, and
/// the rest, which all k classes share evenly. Plain data, by predicted slot.
struct LabelEvidence {
  struct Share {
    uint16_t slot = 0;
    float evidence = 0;
    bool operator==(const Share&) const = default;
  };
  std::vector<std::vector<Share>> shares;  ///< most evidence first
  std::vector<float> even;

  int classes() const { return int(shares.size()); }
};

/// P(true | predicted) from how often each true class (row) was labelled as each class (column), `counts` or shares of
/// pixels, k * k: alpha_i += P(i | j) for a pixel labelled j (INFERENCE section 6). The `most` greatest classes of each
/// prediction are named, the others share the rest. A class that was never predicted is believed as it is.
LabelEvidence label_evidence(std::span<const double> counts, int k, int most = 4);

}  // namespace felt
