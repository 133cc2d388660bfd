#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/image.h"
#include "inference/student_t.h"

namespace felt {

/// Counts of (true, predicted) label pairs over k classes; a pixel without a prediction is in column k.
class LabelCounts {
public:
  explicit LabelCounts(int classes) : classes_(classes), counts_(size_t(classes) * size_t(classes + 1)) {}

  int classes() const { return classes_; }
  /// `predicted` outside 0 .. k-1 counts as no prediction; `truth` outside is not counted.
  void add(int truth, int predicted);
  uint64_t count(int truth, int predicted) const { return counts_[size_t(truth * (classes_ + 1) + predicted)]; }
  uint64_t without_prediction(int truth) const { return count(truth, classes_); }

  uint64_t total() const;
  double pixel_accuracy() const;   ///< correct / all, pixels without a prediction counted as wrong; NaN where empty
  double recall(int c) const;      ///< NaN where the class is absent
  double precision(int c) const;   ///< NaN where it was never predicted
  double iou(int c) const;         ///< TP / (TP + FP + FN); NaN where the class is neither true nor predicted
  double mean_recall() const;      ///< over classes that are present in the truth
  double mean_iou() const;         ///< over classes that are present in the truth: one that is never found counts as 0
  double mean_iou_of_all() const;  ///< over classes that are true or predicted: one that is never right counts as 0
  LabelCounts& operator+=(const LabelCounts& other);

private:
  int classes_;
  std::vector<uint64_t> counts_;
};

/// How honest class probabilities are, summed up one prediction at a time.
class CalibrationScores {
public:
  static constexpr int kBins = 15;  ///< of equal width over the confidence 0 .. 1 (Guo et al. 2017)

  struct Bin {
    uint64_t count = 0;
    double confidence_sum = 0;
    uint64_t correct = 0;
  };

  /// One prediction over the classes; `truth` is an index into it. Not finite, negative or not summing to one: not
  /// counted, but noted in `refused`.
  void add(std::span<const double> probability, int truth);
  CalibrationScores& operator+=(const CalibrationScores& other);

  uint64_t count() const { return count_; }
  uint64_t refused() const { return refused_; }
  /// Expected calibration error: over bins, share of predictions times |mean confidence - accuracy|.
  double ece() const;
  /// Mean over predictions of the squared difference to the one-hot truth, summed over classes (0 .. 2).
  double brier() const { return brier_sum_ / double(count_); }
  /// Mean of -log p(truth), nats, p not below 1e-12.
  double nll() const { return nll_sum_ / double(count_); }
  const std::array<Bin, kBins>& bins() const { return bins_; }

private:
  std::array<Bin, kBins> bins_{};
  uint64_t count_ = 0, refused_ = 0;
  double brier_sum_ = 0, nll_sum_ = 0;
};

/// How well property forecasts hold, one true value at a time.
class PropertyScores {
public:
  static constexpr std::array<double, 2> kIntervals = {0.5, 0.9};  ///< central

  /// A forecast as a mixture of Student-t's: its location stands for its mean (they are equal where a mean exists).
  void add(double truth, const StudentTMixture& forecast);
  /// `quantiles` of the forecast at the levels (i + 1/2) / n, ascending; `log_density` at the true value.
  void add(double truth, double mean, double log_density, std::span<const double> quantiles);

  uint64_t count() const { return count_; }
  double mae() const { return absolute_sum_ / double(count_); }  ///< mean |forecast mean - truth|
  double nll() const { return nll_sum_ / double(count_); }       ///< mean of -log density, nats
  /// Continuous ranked probability score as twice the mean pinball loss over the quantile levels (Gneiting and
  /// Raftery 2007), in the property's unit.
  double crps() const { return crps_sum_ / double(count_); }
  /// Share of true values within the central interval `kIntervals[i]`.
  double coverage(int i) const { return double(covered_[size_t(i)]) / double(count_); }

private:
  uint64_t count_ = 0;
  double absolute_sum_ = 0, nll_sum_ = 0, crps_sum_ = 0;
  std::array<uint64_t, kIntervals.size()> covered_{};
};

/// Images of class probability against images of the truth (1 where the class is, else 0), one class of one view at a
/// time.
class ClassImageScores {
public:
  void add(const Image<float>& probability, const Image<float>& truth);
  ClassImageScores& operator+=(const ClassImageScores& other);

  uint64_t images() const { return images_; }
  double psnr_db() const;  ///< of the mean squared difference over all pixels of all images
  double ssim() const;     ///< mean over images
  double binary_cross_entropy() const { return entropy_sum_ / double(pixels_); }  ///< mean over all pixels, nats

private:
  uint64_t images_ = 0, pixels_ = 0;
  double square_sum_ = 0, ssim_sum_ = 0, entropy_sum_ = 0;
};

/// Peak signal-to-noise ratio of values in [0, 1], dB: 10 log10(1 / mean squared difference); infinity where equal.
double psnr_db(const Image<float>& a, const Image<float>& b);
/// Structural similarity of values in [0, 1] (Wang et al. 2004): Gaussian window of 11 pixels, sigma 1.5, K1 = 0.01,
/// K2 = 0.03, mean over the windows that lie inside the image; NaN where none does.
double ssim(const Image<float>& a, const Image<float>& b);
/// Mean of -(y log p + (1 - y) log(1 - p)), nats; y the true value in {0, 1}, p kept within [1e-7, 1 - 1e-7].
double binary_cross_entropy(const Image<float>& probability, const Image<float>& truth);

}  // namespace felt
