#include "inference/priors.h"

#include <cassert>
#include <cmath>

#include "core/error.h"

namespace felt {
namespace {

double total_with_prior(std::span<const double> belief, std::span<const Nig> nig) {
  assert(belief.size() == nig.size());
  double total = 0;
  for (size_t c = 0; c < nig.size(); ++c) total += has_prior(nig[c]) ? belief[c] : 0;
  if (!(total > 0)) throw Error("property: classes: expected at least one class with a prior and belief, found none");
  return total;
}

}  // namespace

Nig calibrated_prior(double mean, double sd, double nu_0) {
  assert(sd > 0 && nu_0 > 0);
  return {mean, nu_0, nu_0 / 2, nu_0 / 2 * sd * sd};
}

std::optional<Nig> published_prior(double mean, double sd, double divisor) {
  if (!(mean > 0)) return std::nullopt;
  const double beta = sd * sd / mean;
  return Nig{mean, 1, beta, std::sqrt(beta) / divisor};
}

StudentTMixture predictive_mixture(std::span<const double> belief, std::span<const Nig> nig) {
  const double total = total_with_prior(belief, nig);
  StudentTMixture m;
  for (size_t c = 0; c < nig.size(); ++c) {
    if (!has_prior(nig[c])) continue;
    m.weight.push_back(belief[c] / total);
    m.component.push_back(predictive(nig[c]));
  }
  return m;
}

std::vector<PlugInNormal> plug_in_mixture(std::span<const double> belief, std::span<const Nig> nig) {
  const double total = total_with_prior(belief, nig);
  std::vector<PlugInNormal> m;
  for (size_t c = 0; c < nig.size(); ++c) {
    if (has_prior(nig[c])) m.push_back({belief[c] / total, nig[c].tau, std::sqrt(plug_in_variance(nig[c]))});
  }
  return m;
}

}  // namespace felt
