#include "mapping/labels/label_calibration.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "core/error.h"
#include "core/text.h"

namespace felt {

double ConfusionCounts::total() const { return std::accumulate(pixels.begin(), pixels.end(), 0.0); }

double ConfusionCounts::correct() const {
  double sum = 0;
  for (int c = 0; c < k; ++c) sum += at(c, c);
  return sum;
}

ConfusionCounts& ConfusionCounts::operator+=(const ConfusionCounts& other) {
  for (size_t i = 0; i < pixels.size(); ++i) pixels[i] += other.pixels[i];
  without_prediction += other.without_prediction;
  without_truth += other.without_truth;
  return *this;
}

void count_confusion(const Frame& predicted, const LabelImage& truth, const ClassTable& classes,
                     ConfusionCounts& counts) {
  const ProbabilityImage& p = predicted.probabilities;
  const int width = p.empty() ? predicted.labels.width() : p.width,
            height = p.empty() ? predicted.labels.height() : p.height;
  if (truth.width() != width || truth.height() != height)
    throw FormatError(describe_mismatch("frame " + std::to_string(predicted.index), "true labels",
                                        size_text(width, height) + " as the predicted ones",
                                        size_text(truth.width(), truth.height())));
  for (size_t pixel = 0; pixel < truth.size(); ++pixel) {
    const uint16_t row = classes.slot_of_id(truth.data()[pixel]);
    if (row == ClassTable::kNoSlot) {
      counts.without_truth += 1;
      continue;
    }
    if (p.empty()) {
      const uint16_t column = classes.slot_of_id(predicted.labels.data()[pixel]);
      (column == ClassTable::kNoSlot ? counts.without_prediction : counts.at(row, column)) += 1;
      continue;
    }
    double named = 0;
    for (size_t i = pixel * size_t(p.top); i < (pixel + 1) * size_t(p.top); ++i) {
      const uint16_t column = classes.slot_of_id(p.class_id[i]);
      if (column == ClassTable::kNoSlot || !(p.probability[i] > 0 && p.probability[i] <= 1)) continue;
      counts.at(row, column) += double(p.probability[i]);
      named += double(p.probability[i]);
    }
    counts.without_prediction += std::max(0.0, 1 - named);
  }
}

ConfusionScores score_confusion(const ConfusionCounts& learned, const ConfusionCounts& held_out) {
  constexpr int kBins = 15;
  const int k = learned.k;
  struct Bin {
    double count = 0, confidence = 0, correct = 0;
  };
  std::array<Bin, kBins> bins;
  ConfusionScores scores;
  const double total = held_out.total();
  if (!(total > 0)) return scores;
  std::vector<double> p(static_cast<size_t>(k));
  for (int predicted = 0; predicted < k; ++predicted) {
    double column = 0;
    for (int truth = 0; truth < k; ++truth) column += learned.at(truth, predicted);
    double squares = 0;
    for (int truth = 0; truth < k; ++truth) {
      p[size_t(truth)] = column > 0 ? learned.at(truth, predicted) / column : double(truth == predicted);
      squares += p[size_t(truth)] * p[size_t(truth)];
    }
    const int best = int(std::max_element(p.begin(), p.end()) - p.begin());
    const double confidence = p[size_t(best)];
    Bin& bin = bins[size_t(std::clamp(int(std::ceil(confidence * kBins)) - 1, 0, kBins - 1))];
    for (int truth = 0; truth < k; ++truth) {
      const double n = held_out.at(truth, predicted);
      bin.count += n;
      bin.confidence += n * confidence;
      bin.correct += truth == best ? n : 0;
      scores.brier += n * (squares - 2 * p[size_t(truth)] + 1);
      scores.nll -= n * std::log(std::max(p[size_t(truth)], 1e-12));
    }
  }
  for (const Bin& bin : bins) scores.ece += std::abs(bin.confidence - bin.correct) / total;
  scores.accuracy = held_out.correct() / total;
  scores.brier /= total;
  scores.nll /= total;
  return scores;
}

}  // namespace felt
