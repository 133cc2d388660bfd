// How often a region's class is right after touching it, simulated (docs/inference.md, "Simulated labels").
//
//   bench_labels [regions per class]
//
// A region has one true material and one vision label, right with that material's accuracy and else uniform over the
// other seven. Readings are drawn from the friction table. Two protocols:
//   paper  - only regions whose label is wrong are touched
//   honest - every region is touched
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "bench/paper/friction_table.h"
#include "inference/class_posterior.h"
#include "inference/decision.h"
#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/priors.h"

namespace felt {
namespace {

using paper::kMaterials;
constexpr size_t kClasses = kMaterials.size();

std::vector<Nig> calibrated() {
  std::vector<Nig> prior;
  for (const auto& m : kMaterials) prior.push_back(calibrated_prior(m.mean, m.sd));
  return prior;
}

std::vector<Nig> printed() {
  std::vector<Nig> prior;
  for (const auto& m : kMaterials) prior.push_back(*published_prior(m.mean, m.sd));
  return prior;
}

/// One count on top of a flat prior: belief 2/9 in the label, whatever its accuracy.
std::vector<double> printed_vision(size_t label) {
  std::vector<double> alpha(kClasses, 1);
  alpha[label] += 1;
  return alpha;
}

/// Bayes' rule with the confusion matrix that produced the label, and a flat prior over materials.
std::vector<double> calibrated_vision(size_t label) {
  std::vector<double> belief(kClasses);
  for (size_t c = 0; c < kClasses; ++c) {
    const double accuracy = kMaterials[c].vision_accuracy;
    belief[c] = c == label ? accuracy : (1 - accuracy) / (kClasses - 1);
  }
  return belief;
}

struct Experiment {
  const char* name;
  bool touch_only_where_wrong;
  std::vector<double> (*vision)(size_t label);
  std::vector<Nig> prior;
  double true_rho;     ///< correlation of the readings of a region
  double assumed_rho;  ///< what the model thinks it is
  std::vector<int> touches;
  /// Whether a reading changes what the next one is compared with. Algorithm 1 as printed never feeds the updated
  /// parameters back: then the evidence of several readings is the product of their evidences under the prior.
  bool feeds_back = true;
};

std::vector<double> class_belief(const Experiment& e, size_t label, std::span<const double> psi) {
  const std::vector<double> vision = e.vision(label);
  if (e.feeds_back) return material_posterior(vision, e.prior, statistics_of(psi), e.assumed_rho).belief.p;
  std::vector<double> evidence(kClasses, 0);
  for (size_t c = 0; c < kClasses; ++c)
    for (double x : psi) evidence[c] += log_evidence(e.prior[c], x);
  return class_posterior(vision, evidence).p;
}

struct Outcome {
  std::vector<double> accuracy;  ///< by class
  double macro = 0;
};

Outcome run(const Experiment& e, int touches, int regions) {
  Outcome outcome;
  for (size_t z = 0; z < kClasses; ++z) {
    std::mt19937_64 rng(1000 * z + 7);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    std::uniform_int_distribution<size_t> other(1, kClasses - 1);
    int right = 0;
    std::vector<double> psi(static_cast<size_t>(touches));
    for (int i = 0; i < regions; ++i) {
      const bool label_right = uniform(rng) < kMaterials[z].vision_accuracy;
      const size_t label = label_right ? z : (z + other(rng)) % kClasses;
      const double region = std::sqrt(e.true_rho) * normal(rng);
      for (double& x : psi) {
        x = kMaterials[z].mean + kMaterials[z].sd * (region + std::sqrt(1 - e.true_rho) * normal(rng));
      }
      if (e.touch_only_where_wrong && label_right) {
        ++right;
        continue;
      }
      right += most_probable_class(class_belief(e, label, psi)) == int(z);
    }
    outcome.accuracy.push_back(double(right) / regions);
    outcome.macro += outcome.accuracy.back() / kClasses;
  }
  return outcome;
}

/// The paper's update read literally: the class is the largest of a^. It is the label, always.
double macro_of_projected_concentrations(int regions) {
  const std::vector<Nig> prior = calibrated();
  double macro = 0;
  for (size_t z = 0; z < kClasses; ++z) {
    std::mt19937_64 rng(1000 * z + 7);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform;
    std::uniform_int_distribution<size_t> other(1, kClasses - 1);
    int right = 0;
    for (int i = 0; i < regions; ++i) {
      const size_t label = uniform(rng) < kMaterials[z].vision_accuracy ? z : (z + other(rng)) % kClasses;
      const double psi = kMaterials[z].mean + kMaterials[z].sd * normal(rng);
      const MixtureUpdate u = mixture_update(printed_vision(label), prior, psi);
      right += most_probable_class(u.a) == int(z);
    }
    macro += double(right) / regions / kClasses;
  }
  return macro;
}

}  // namespace
}  // namespace felt

int main(int argc, char** argv) {
  using namespace felt;
  const int regions = argc > 1 ? std::max(1, std::atoi(argv[1])) : 20000;
  const Experiment experiments[] = {
      {"paper's protocol, printed vision, calibrated property prior", true, printed_vision, calibrated(), 0, 0, {1, 3}},
      {"paper's protocol, printed vision, printed property prior", true, printed_vision, printed(), 0, 0, {1}},
      {"honest, calibrated vision, calibrated property prior",
       false,
       calibrated_vision,
       calibrated(),
       0,
       0,
       {1, 2, 3, 5}},
      {"honest, printed vision, calibrated property prior", false, printed_vision, calibrated(), 0, 0, {1, 2, 3, 5}},
      {"honest, printed vision, printed property prior", false, printed_vision, printed(), 0, 0, {1, 2, 3}},
      {"honest, printed vision, printed property prior, not fed back",
       false,
       printed_vision,
       printed(),
       0,
       0,
       {1, 2, 3},
       false},
      {"honest, calibrated, correlated (.8) but treated as independent, not fed back",
       false,
       calibrated_vision,
       calibrated(),
       0.8,
       0,
       {1, 2, 3, 4, 5},
       false},
      {"honest, calibrated, readings correlated (.8) but treated as independent",
       false,
       calibrated_vision,
       calibrated(),
       0.8,
       0,
       {1, 2, 3, 4, 5}},
      {"honest, calibrated, readings correlated (.8) and modelled so",
       false,
       calibrated_vision,
       calibrated(),
       0.8,
       0.8,
       {1, 2, 3, 4, 5}},
  };
  std::printf("%d regions a class\n%-76s touches  macro ", regions, "");
  for (const auto& m : paper::kMaterials) std::printf(" %8s", m.name);
  std::printf("\n");
  for (const Experiment& e : experiments) {
    for (int touches : e.touches) {
      const Outcome outcome = run(e, touches, regions);
      std::printf("%-76s %7d  %.3f ", e.name, touches, outcome.macro);
      for (double accuracy : outcome.accuracy) std::printf(" %8.2f", accuracy);
      std::printf("\n");
    }
  }
  std::printf("%-76s %7d  %.3f\n", "honest, printed vision: class of the projected concentrations", 1,
              macro_of_projected_concentrations(std::max(1, regions / 10)));
  return 0;
}
