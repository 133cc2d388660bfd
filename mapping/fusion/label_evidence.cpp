#include "mapping/fusion/label_evidence.h"

#include <algorithm>
#include <cassert>
#include <numeric>

namespace felt {

LabelEvidence label_evidence(std::span<const double> counts, int k, int most) {
  assert(counts.size() == size_t(k) * size_t(k));
  LabelEvidence evidence;
  evidence.shares.resize(size_t(k));
  evidence.even.resize(size_t(k));
  std::vector<int> order(static_cast<size_t>(k));
  for (int predicted = 0; predicted < k; ++predicted) {
    const auto count = [&](int truth) { return counts[size_t(truth) * size_t(k) + size_t(predicted)]; };
    double all = 0;
    for (int truth = 0; truth < k; ++truth) all += count(truth);
    const auto p = [&](int truth) { return all > 0 ? count(truth) / all : double(truth == predicted); };
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return p(a) > p(b); });
    const int named = std::min(most, k);
    double rest = 0;
    for (int r = named; r < k; ++r) rest += p(order[size_t(r)]);
    // Even evidence reaches the named classes too: they name that much less.
    const double share = named < k ? rest / (k - named) : 0;
    for (int r = 0; r < named; ++r)
      if (const double own = p(order[size_t(r)]) - share; own > 0)
        evidence.shares[size_t(predicted)].push_back({uint16_t(order[size_t(r)]), float(own)});
    evidence.even[size_t(predicted)] = float(share * k);
  }
  return evidence;
}

}  // namespace felt
