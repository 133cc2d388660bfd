#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "bench/paper/friction_table.h"
#include "inference/nig.h"
#include "mapping/evaluation/evaluate_predictions.h"

// How often a region's class is right after touching it, simulated (docs/inference.md, "Simulated labels").
//
// A region has one true material and one vision label, right with that material's accuracy and else uniform over the
// other seven. Readings are drawn from the friction table.
namespace felt::paper {

inline constexpr size_t kClasses = kMaterials.size();

/// Where touches go.
enum class Places {
  where_wrong,  ///< the paper's: regions whose label is wrong, each equally often; the others keep their label
  everywhere,   ///< each region equally often
  at_random,    ///< as many touches as regions, times `touches`, at places drawn with replacement
  suggested,    ///< the same number, each where the expected information gain is largest
};

/// What is believed of a label.
enum class Vision {
  paper,       ///< one count on top of a flat prior: 2/9 for the label, whatever its accuracy
  calibrated,  ///< Bayes' rule with the confusion matrix that made it, and a flat prior over materials
  told,        ///< the paper's, and that the label is wrong: what its protocol gives away
};

struct LabelExperiment {
  Places places = Places::everywhere;
  Vision vision = Vision::calibrated;
  bool printed_property_prior = false;
  int touches = 0;         ///< of a region (`suggested`, `at_random`: on average)
  double true_rho = 0;     ///< correlation of the readings of a region
  double assumed_rho = 0;  ///< what the model thinks it is
  /// Whether a reading changes what the next one is compared with. Algorithm 1 as printed never feeds the updated
  /// parameters back: several readings then weigh as the product of their evidences under the prior.
  bool fed_back = true;
  /// The paper's Algorithm 1 read literally: the class is that of the largest projected concentration, from the paper's
  /// vision prior.
  bool projected_concentrations = false;
};

struct LabelOutcome {
  std::array<double, kClasses> accuracy{};
  int regions = 0;  ///< of each class
  CalibrationScores calibration;
  double binary_cross_entropy = 0;  ///< mean over regions and classes, nats
  std::vector<uint8_t> right;       ///< region by region
  double macro() const;
  double macro_error() const;  ///< standard error
  /// Peak signal-to-noise ratio of the class probabilities against the truth, dB.
  double psnr_db() const;
};

/// Regions are the same (truth, label, readings) for every experiment of equal `true_rho`, so that outcomes can be
/// compared in pairs. In parallel; the same for any number of threads.
LabelOutcome simulate_labels(const LabelExperiment& experiment, int regions_per_class);

/// Share of regions that one outcome has right and the other has not, less the other way round, with its standard
/// error.
struct PairedDifference {
  double difference = 0, error = 0;
};
PairedDifference compare(const LabelOutcome& better, const LabelOutcome& worse);

}  // namespace felt::paper
