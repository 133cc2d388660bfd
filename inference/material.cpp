#include "inference/material.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <numbers>

#include "inference/noise.h"
#include "inference/projection.h"
#include "inference/special_functions.h"

namespace felt {
namespace {

MaterialPosterior posterior_of(std::span<const double> vision_belief, std::vector<MaterialClass> classes) {
  std::vector<double> log_likelihood(classes.size());
  std::transform(classes.begin(), classes.end(), log_likelihood.begin(),
                 [](const MaterialClass& c) { return c.log_evidence; });
  return {class_posterior(vision_belief, log_likelihood), std::move(classes)};
}

const MaterialClass kNoPart{-std::numeric_limits<double>::infinity(), Nig{}, StudentT{}};

}  // namespace

ReadingStatistics statistics_of(std::span<const double> psi) {
  ReadingStatistics s;
  for (double x : psi) {  // Welford: no difference of large sums
    s.n += 1;
    const double d = x - s.mean;
    s.mean += d / s.n;
    s.m2 += d * (x - s.mean);
  }
  return s;
}

MaterialClass material_class(const Nig& prior, const ReadingStatistics& readings, double rho) {
  if (!has_prior(prior)) return kNoPart;
  const double n = readings.n;
  const double within = 1 - rho, between = rho + 1 / prior.kappa;  // in units of sigma^2
  if (n == 0) return {0, prior, {prior.tau, plug_in_variance(prior) * (within + between), 2 * prior.beta}};

  const double inflation = 1 + (n - 1) * rho;
  const double n_effective = n / inflation;
  const double d = readings.mean - prior.tau;
  const double kappa = prior.kappa + n_effective;
  const double half_squares = 0.5 * (readings.m2 / within + prior.kappa * n_effective * d * d / kappa);
  const Nig posterior{prior.tau + n_effective * d / kappa, kappa, prior.beta + n / 2, prior.gamma + half_squares};

  const double log_evidence = log_gamma_difference(prior.beta, n / 2) -
                              posterior.beta * std::log1p(half_squares / prior.gamma) -
                              0.5 * (std::log1p(n_effective / prior.kappa) + (n - 1) * std::log1p(-rho) +
                                     std::log(inflation) + n * std::log(2 * std::numbers::pi * prior.gamma));
  const double pull = n * between / (within + n * between);
  const StudentT next_here{prior.tau + pull * d,
                           plug_in_variance(posterior) * (within + within * between / (within + n * between)),
                           2 * posterior.beta};
  return {log_evidence, posterior, next_here};
}

MaterialPosterior material_posterior(std::span<const double> vision_belief, std::span<const Nig> prior,
                                     const ReadingStatistics& readings, double rho) {
  assert(vision_belief.size() == prior.size());
  std::vector<MaterialClass> classes(prior.size());
  std::transform(prior.begin(), prior.end(), classes.begin(),
                 [&](const Nig& p) { return material_class(p, readings, rho); });
  return posterior_of(vision_belief, std::move(classes));
}

MaterialPosterior material_posterior(std::span<const double> vision_belief, std::span<const Nig> prior,
                                     std::span<const double> psi, std::span<const double> noise_sd, double rho) {
  assert(vision_belief.size() == prior.size() && (noise_sd.empty() || noise_sd.size() == psi.size()));
  if (std::all_of(noise_sd.begin(), noise_sd.end(), [](double s) { return s == 0; })) {
    return material_posterior(vision_belief, prior, statistics_of(psi), rho);
  }
  std::vector<MaterialClass> classes(prior.size());
  std::transform(prior.begin(), prior.end(), classes.begin(),
                 [&](const Nig& p) { return has_prior(p) ? noisy_material_class(p, psi, noise_sd, rho) : kNoPart; });
  return posterior_of(vision_belief, std::move(classes));
}

MomentMatchedView moment_matched_view(const MaterialPosterior& posterior, std::span<const Nig> prior,
                                      double total_concentration) {
  const ClassPosterior& belief = posterior.belief;
  assert(belief.p.size() == prior.size());
  MomentMatchedView view{std::vector<double>(prior.size()), std::vector<Nig>(prior.size())};
  for (size_t c = 0; c < prior.size(); ++c) {
    // Views are stored as floats, and a concentration must stay positive.
    view.a[c] = std::max(belief.p[c] * total_concentration, double(std::numeric_limits<float>::min()));
    if (!has_prior(prior[c])) continue;
    view.nig[c] = project_nig_kl(prior[c], posterior.classes[c].posterior, belief.p[c], belief.not_p[c]);
  }
  return view;
}

}  // namespace felt
