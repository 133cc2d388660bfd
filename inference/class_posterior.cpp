#include "inference/class_posterior.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "core/error.h"

namespace felt {

ClassPosterior class_posterior(std::span<const double> weight, std::span<const double> log_likelihood) {
  assert(weight.size() == log_likelihood.size());
  const size_t k = weight.size();
  constexpr double kOut = -std::numeric_limits<double>::infinity();
  ClassPosterior result;
  result.p.resize(k);
  result.not_p.resize(k);

  double total_weight = 0, best = kOut;
  size_t winner = 0;
  for (size_t c = 0; c < k; ++c) {
    if (log_likelihood[c] == kOut) continue;
    total_weight += weight[c];
    const double score = std::log(weight[c]) + log_likelihood[c];
    if (score > best) {
      best = score;
      winner = c;
    }
  }
  if (best == kOut) throw Error("touch: classes: expected at least one class with a prior and belief, found none");

  double losers = 0;  // mass of all but the winner, whose own is 1
  for (size_t c = 0; c < k; ++c) {
    const double mass = std::exp(std::log(weight[c]) + log_likelihood[c] - best);
    result.p[c] = c == winner ? 1 : mass;
    losers += c == winner ? 0 : mass;
  }
  for (size_t c = 0; c < k; ++c) {
    result.not_p[c] = (c == winner ? losers : 1 + (losers - result.p[c])) / (1 + losers);
    result.p[c] /= 1 + losers;
  }
  result.log_evidence = best + std::log1p(losers) - std::log(total_weight);
  return result;
}

}  // namespace felt
