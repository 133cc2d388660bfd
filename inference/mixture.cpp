#include "inference/mixture.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "inference/dirichlet.h"
#include "inference/noise.h"

namespace felt {
namespace {

std::vector<NoisyReading> read_as_each_class(std::span<const Nig> prior, double psi, double noise_sd) {
  std::vector<NoisyReading> result(prior.size());
  for (size_t c = 0; c < prior.size(); ++c) {
    result[c] = has_prior(prior[c]) ? noisy_update(prior[c], psi, noise_sd)
                                    : NoisyReading{-std::numeric_limits<double>::infinity(), Nig{}};
  }
  return result;
}

ClassPosterior posterior_of(std::span<const double> a, std::span<const NoisyReading> reading) {
  std::vector<double> log_likelihood(reading.size());
  std::transform(reading.begin(), reading.end(), log_likelihood.begin(),
                 [](const NoisyReading& x) { return x.log_evidence; });
  return class_posterior(a, log_likelihood);
}

}  // namespace

ClassPosterior responsibilities(std::span<const double> a, std::span<const Nig> prior, double psi, double noise_sd) {
  assert(a.size() == prior.size());
  return posterior_of(a, read_as_each_class(prior, psi, noise_sd));
}

MixtureUpdate mixture_update(std::span<const double> a, std::span<const Nig> prior, double psi, double noise_sd,
                             Projection projection) {
  assert(a.size() == prior.size());
  const size_t k = a.size();
  const std::vector<NoisyReading> reading = read_as_each_class(prior, psi, noise_sd);
  MixtureUpdate result{posterior_of(a, reading), std::vector<double>(k), std::vector<Nig>(k)};
  const std::vector<double>&r = result.responsibility.p, &not_r = result.responsibility.not_p;

  if (projection == Projection::kl) {
    project_dirichlet_kl(a, r, not_r, result.a);
  } else {
    project_dirichlet_published(a, r, not_r, result.a);
  }
  for (size_t c = 0; c < k; ++c) {
    result.valid = result.valid && result.a[c] > 0 && std::isfinite(result.a[c]);
    if (!has_prior(prior[c])) continue;
    const auto project = projection == Projection::kl ? project_nig_kl : project_nig_published;
    result.nig[c] = project(prior[c], reading[c].posterior, r[c], not_r[c]);
    result.valid = result.valid && is_valid(result.nig[c]);
  }
  return result;
}

}  // namespace felt
