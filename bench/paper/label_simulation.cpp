#include "bench/paper/label_simulation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "inference/class_posterior.h"
#include "inference/decision.h"
#include "inference/information_gain.h"
#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/priors.h"

namespace felt::paper {
namespace {

constexpr int kMostTouches = 40;  ///< of one region, where places are not fixed
constexpr int kPopulation = 400;  ///< regions among which touches are handed out
using Belief = std::array<double, kClasses>;

struct SimulatedRegion {
  size_t truth = 0, label = 0;
  std::array<double, kMostTouches> reading{};
};

std::vector<SimulatedRegion> regions_of(size_t truth, int count, double rho) {
  std::mt19937_64 rng(1000 * truth + 7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  std::uniform_int_distribution<size_t> other(1, kClasses - 1);
  const Material& material = kMaterials[truth];
  std::vector<SimulatedRegion> regions(static_cast<size_t>(count));
  for (SimulatedRegion& r : regions) {
    r.truth = truth;
    r.label = uniform(rng) < material.vision_accuracy ? truth : (truth + other(rng)) % kClasses;
    const double common = std::sqrt(rho) * normal(rng);
    for (double& psi : r.reading) psi = material.mean + material.sd * (common + std::sqrt(1 - rho) * normal(rng));
  }
  return regions;
}

std::vector<Nig> property_prior(bool printed) {
  std::vector<Nig> prior;
  for (const Material& m : kMaterials)
    prior.push_back(printed ? *published_prior(m.mean, m.sd) : calibrated_prior(m.mean, m.sd));
  return prior;
}

Belief vision_belief(Vision vision, size_t label) {
  Belief belief;
  for (size_t c = 0; c < kClasses; ++c) {
    const double accuracy = kMaterials[c].vision_accuracy;
    switch (vision) {
      case Vision::paper:
        belief[c] = c == label ? 2 : 1;
        break;
      case Vision::calibrated:
        belief[c] = c == label ? accuracy : (1 - accuracy) / (kClasses - 1);
        break;
      case Vision::told:
        belief[c] = c == label ? 0 : 1;
        break;
    }
  }
  double sum = 0;
  for (const double b : belief) sum += b;
  for (double& b : belief) b /= sum;
  return belief;
}

MaterialPosterior posterior(const LabelExperiment& e, const std::vector<Nig>& prior, const SimulatedRegion& region,
                            int touches) {
  const Belief vision = vision_belief(e.vision, region.label);
  const auto readings = std::span(region.reading).first(size_t(touches));
  if (e.fed_back) return material_posterior(vision, prior, statistics_of(readings), e.assumed_rho);
  MaterialPosterior unchanged = material_posterior(vision, prior, ReadingStatistics{}, e.assumed_rho);
  Belief evidence{};
  for (size_t c = 0; c < kClasses; ++c)
    for (const double psi : readings) evidence[c] += log_evidence(prior[c], psi);
  unchanged.belief = class_posterior(vision, evidence);
  return unchanged;
}

/// Class belief after touches of a region by projected concentrations.
Belief projected_belief(const std::vector<Nig>& prior, const SimulatedRegion& region, int touches) {
  std::vector<double> a(kClasses, 1);
  a[region.label] += 1;
  std::vector<Nig> nig = prior;
  for (int t = 0; t < touches; ++t) {
    MixtureUpdate u = mixture_update(a, nig, region.reading[size_t(t)]);
    a = std::move(u.a), nig = std::move(u.nig);
  }
  double total = 0;
  for (const double x : a) total += x;
  Belief belief;
  for (size_t c = 0; c < kClasses; ++c) belief[c] = a[c] / total;
  return belief;
}

/// Expected information of the next reading in a region.
double gain(const MaterialPosterior& p) {
  StudentTMixture next;
  next.weight = p.belief.p;
  for (const MaterialClass& c : p.classes) next.component.push_back(c.next_here);
  return information_gain(next).value;
}

/// How often each region of a population is touched.
std::vector<int> hand_out(const LabelExperiment& e, const std::vector<Nig>& prior,
                          const std::vector<const SimulatedRegion*>& population, uint64_t seed) {
  std::vector<int> touches(population.size(), 0);
  const size_t budget = population.size() * size_t(e.touches);
  if (e.places == Places::at_random) {
    std::mt19937_64 rng(seed);
    std::uniform_int_distribution<size_t> any(0, population.size() - 1);
    for (size_t i = 0; i < budget; ++i) ++touches[any(rng)];
    return touches;
  }
  std::vector<double> worth;
  Belief untouched;  // only the label is known then
  for (size_t label = 0; label < kClasses; ++label) {
    SimulatedRegion region;
    region.label = label;
    untouched[label] = gain(posterior(e, prior, region, 0));
  }
  for (const SimulatedRegion* r : population) worth.push_back(untouched[r->label]);
  for (size_t i = 0; i < budget; ++i) {
    const auto best = size_t(std::max_element(worth.begin(), worth.end()) - worth.begin());
    ++touches[best];
    worth[best] = touches[best] < kMostTouches ? gain(posterior(e, prior, *population[best], touches[best])) : -1;
  }
  return touches;
}

/// Touches of every region of every class.
std::vector<std::vector<int>> touches_of(const LabelExperiment& e, const std::vector<Nig>& prior,
                                         const std::vector<std::vector<SimulatedRegion>>& all) {
  std::vector<std::vector<int>> touches;
  for (const auto& regions : all) {
    touches.emplace_back(regions.size(), e.touches);
    if (e.places != Places::where_wrong) continue;
    for (size_t i = 0; i < regions.size(); ++i)
      if (regions[i].label == regions[i].truth) touches.back()[i] = 0;
  }
  if (e.places != Places::at_random && e.places != Places::suggested) return touches;
  constexpr size_t kPerClass = kPopulation / kClasses;
  const size_t populations = (all[0].size() + kPerClass - 1) / kPerClass;
  tbb::parallel_for(size_t(0), populations, [&](size_t n) {
    const size_t first = n * kPerClass, end = std::min(first + kPerClass, all[0].size());
    std::vector<const SimulatedRegion*> population;
    for (const auto& regions : all)
      for (size_t i = first; i < end; ++i) population.push_back(&regions[i]);
    const std::vector<int> handed = hand_out(e, prior, population, n);
    for (size_t c = 0, i = 0; c < all.size(); ++c)
      for (size_t r = first; r < end; ++r, ++i) touches[c][r] = handed[i];
  });
  return touches;
}

/// Class beliefs after the touches, region by region.
struct Results {
  std::vector<std::vector<Belief>> belief;
  std::vector<std::vector<uint8_t>> right;
};

Results results_of(const LabelExperiment& e, int regions_per_class) {
  const std::vector<Nig> prior = property_prior(e.printed_property_prior);
  std::vector<std::vector<SimulatedRegion>> all(kClasses);
  tbb::parallel_for(size_t(0), kClasses, [&](size_t c) { all[c] = regions_of(c, regions_per_class, e.true_rho); });
  const auto touches = touches_of(e, prior, all);
  Results results{std::vector<std::vector<Belief>>(kClasses), std::vector<std::vector<uint8_t>>(kClasses)};
  tbb::parallel_for(size_t(0), kClasses, [&](size_t c) {
    for (size_t i = 0; i < all[c].size(); ++i) {
      const SimulatedRegion& region = all[c][i];
      // A region that is not touched keeps its label: what `told` knows is known of touched ones.
      Belief belief =
          vision_belief(touches[c][i] == 0 && e.vision == Vision::told ? Vision::paper : e.vision, region.label);
      if (e.projected_concentrations) {
        belief = projected_belief(prior, region, touches[c][i]);
      } else if (touches[c][i] > 0) {
        const auto p = posterior(e, prior, region, touches[c][i]).belief.p;
        std::copy(p.begin(), p.end(), belief.begin());
      }
      results.belief[c].push_back(belief);
      results.right[c].push_back(most_probable_class(belief) == int(c));
    }
  });
  return results;
}

}  // namespace

double LabelOutcome::macro() const {
  double sum = 0;
  for (const double a : accuracy) sum += a;
  return sum / kClasses;
}

double LabelOutcome::macro_error() const {
  double variance = 0;
  for (const double a : accuracy) variance += a * (1 - a) / regions;
  return std::sqrt(variance) / kClasses;
}

double LabelOutcome::psnr_db() const { return 10 * std::log10(double(kClasses) / calibration.brier()); }

LabelOutcome simulate_labels(const LabelExperiment& e, int regions_per_class) {
  const Results results = results_of(e, regions_per_class);
  LabelOutcome outcome;
  outcome.regions = regions_per_class;
  double entropy = 0;
  for (size_t c = 0; c < kClasses; ++c) {
    int right = 0;
    for (size_t i = 0; i < results.belief[c].size(); ++i) {
      const Belief& belief = results.belief[c][i];
      right += results.right[c][i];
      outcome.right.push_back(results.right[c][i]);
      outcome.calibration.add(belief, int(c));
      for (size_t j = 0; j < kClasses; ++j)
        entropy -= std::log(std::clamp(j == c ? belief[j] : 1 - belief[j], 1e-7, 1.0));
    }
    outcome.accuracy[c] = double(right) / regions_per_class;
  }
  outcome.binary_cross_entropy = entropy / double(kClasses * kClasses * size_t(regions_per_class));
  return outcome;
}

PairedDifference compare(const LabelOutcome& better, const LabelOutcome& worse) {
  double sum = 0, squares = 0;
  const auto n = double(better.right.size());
  for (size_t i = 0; i < better.right.size(); ++i) {
    const double d = double(better.right[i]) - double(worse.right[i]);
    sum += d, squares += d * d;
  }
  const double mean = sum / n;
  return {mean, std::sqrt((squares / n - mean * mean) / n)};
}

}  // namespace felt::paper
