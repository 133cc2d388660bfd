#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/class_table.h"
#include "core/frame.h"

namespace felt {

/// How often each true class (row) was labelled as each class (column), k * k pixels by slot, and what could not be
/// counted.
struct ConfusionCounts {
  int k = 0;
  std::vector<double> pixels;     ///< k * k
  double without_prediction = 0;  ///< pixels of a known true class whose label is ignored, unknown or none
  double without_truth = 0;       ///< pixels whose true class is ignored, unknown or none

  explicit ConfusionCounts(int k_ = 0) : k(k_), pixels(size_t(k_) * size_t(k_), 0.0) {}
  double& at(int truth, int predicted) { return pixels[size_t(truth) * size_t(k) + size_t(predicted)]; }
  double at(int truth, int predicted) const { return pixels[size_t(truth) * size_t(k) + size_t(predicted)]; }
  double total() const;
  double correct() const;
  ConfusionCounts& operator+=(const ConfusionCounts& other);
};

/// Counts one frame's labels, or its probabilities where it has them, against true labels of the same size; both with
/// ids of the table. Throws FormatError where the sizes differ.
void count_confusion(const Frame& predicted, const LabelImage& truth, const ClassTable& classes,
                     ConfusionCounts& counts);

/// How honest P(true | predicted) learned from `learned` is on `held_out`, a pixel a prediction.
struct ConfusionScores {
  double accuracy = 0;  ///< of the label as predicted
  double ece = 0;       ///< 15 bins of equal width over the greatest probability
  double brier = 0;     ///< squared difference to the one-hot truth, summed over classes (0 .. 2)
  double nll = 0;       ///< mean -log p(true), nats, p not below 1e-12
};
ConfusionScores score_confusion(const ConfusionCounts& learned, const ConfusionCounts& held_out);

}  // namespace felt
