#include "mapping/evaluation/evaluate_predictions.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace felt {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double ratio(uint64_t part, uint64_t whole) { return whole > 0 ? double(part) / double(whole) : kNone; }

/// Mean of `score` over classes that occur in the truth.
template <typename Score>
double mean_over_present(const LabelCounts& m, Score score) {
  double sum = 0;
  int present = 0;
  for (int c = 0; c < m.classes(); ++c) {
    if (std::isnan(m.recall(c))) continue;
    sum += score(c);
    ++present;
  }
  return present > 0 ? sum / present : kNone;
}

}  // namespace

void LabelCounts::add(int truth, int predicted) {
  if (truth < 0 || truth >= classes_) return;
  const int column = predicted >= 0 && predicted < classes_ ? predicted : classes_;
  ++counts_[size_t(truth * (classes_ + 1) + column)];
}

uint64_t LabelCounts::total() const {
  uint64_t sum = 0;
  for (const uint64_t n : counts_) sum += n;
  return sum;
}

double LabelCounts::pixel_accuracy() const {
  uint64_t correct = 0;
  for (int c = 0; c < classes_; ++c) correct += count(c, c);
  return ratio(correct, total());
}

double LabelCounts::recall(int c) const {
  uint64_t row = 0;
  for (int p = 0; p <= classes_; ++p) row += count(c, p);
  return ratio(count(c, c), row);
}

double LabelCounts::precision(int c) const {
  uint64_t column = 0;
  for (int t = 0; t < classes_; ++t) column += count(t, c);
  return ratio(count(c, c), column);
}

double LabelCounts::iou(int c) const {
  uint64_t either = 0;
  for (int p = 0; p <= classes_; ++p) either += count(c, p);
  for (int t = 0; t < classes_; ++t) either += t == c ? 0 : count(t, c);
  return ratio(count(c, c), either);
}

double LabelCounts::mean_recall() const {
  return mean_over_present(*this, [&](int c) { return recall(c); });
}

double LabelCounts::mean_iou() const {
  return mean_over_present(*this, [&](int c) { return iou(c); });
}

double LabelCounts::mean_iou_of_all() const {
  double sum = 0;
  int classes = 0;
  for (int c = 0; c < classes_; ++c) {
    if (std::isnan(iou(c))) continue;
    sum += iou(c);
    ++classes;
  }
  return classes > 0 ? sum / classes : kNone;
}

LabelCounts& LabelCounts::operator+=(const LabelCounts& other) {
  assert(classes_ == other.classes_);
  for (size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
  return *this;
}

CalibrationScores& CalibrationScores::operator+=(const CalibrationScores& other) {
  for (int i = 0; i < kBins; ++i) {
    bins_[i].count += other.bins_[i].count;
    bins_[i].confidence_sum += other.bins_[i].confidence_sum;
    bins_[i].correct += other.bins_[i].correct;
  }
  count_ += other.count_, refused_ += other.refused_;
  brier_sum_ += other.brier_sum_, nll_sum_ += other.nll_sum_;
  return *this;
}

void CalibrationScores::add(std::span<const double> probability, int truth) {
  double sum = 0;
  bool valid = truth >= 0 && size_t(truth) < probability.size();
  for (const double p : probability) {
    valid = valid && p >= 0;
    sum += p;
  }
  if (!valid || !(std::abs(sum - 1) < 1e-3)) {
    ++refused_;
    return;
  }
  const auto best = size_t(std::max_element(probability.begin(), probability.end()) - probability.begin());
  const double confidence = probability[best];
  // Bin i holds confidences in (i / 15, (i + 1) / 15].
  Bin& bin = bins_[size_t(std::clamp(int(std::ceil(confidence * kBins)) - 1, 0, kBins - 1))];
  ++bin.count;
  bin.confidence_sum += confidence;
  bin.correct += best == size_t(truth);
  ++count_;
  for (size_t c = 0; c < probability.size(); ++c) {
    const double difference = probability[c] - (c == size_t(truth) ? 1 : 0);
    brier_sum_ += difference * difference;
  }
  nll_sum_ -= std::log(std::max(probability[size_t(truth)], 1e-12));
}

double CalibrationScores::ece() const {
  double sum = 0;
  for (const Bin& bin : bins_) sum += std::abs(bin.confidence_sum - double(bin.correct));
  return sum / double(count_);
}

void PropertyScores::add(double truth, double mean, double log_density, std::span<const double> quantiles) {
  assert(!quantiles.empty());
  ++count_;
  absolute_sum_ += std::abs(mean - truth);
  nll_sum_ -= log_density;
  const auto n = double(quantiles.size());
  double pinball = 0;
  for (size_t i = 0; i < quantiles.size(); ++i) {
    const double level = (double(i) + 0.5) / n, above = truth - quantiles[i];
    pinball += above >= 0 ? level * above : (level - 1) * above;
  }
  crps_sum_ += 2 * pinball / n;
  // Between levels the quantile is interpolated.
  const auto quantile = [&](double level) {
    const double at = std::clamp(level * n - 0.5, 0.0, n - 1);
    const auto low = size_t(at), high = std::min(low + 1, quantiles.size() - 1);
    return quantiles[low] + (at - double(low)) * (quantiles[high] - quantiles[low]);
  };
  for (size_t i = 0; i < kIntervals.size(); ++i)
    covered_[i] += truth >= quantile(0.5 - kIntervals[i] / 2) && truth <= quantile(0.5 + kIntervals[i] / 2);
}

void PropertyScores::add(double truth, const StudentTMixture& forecast) {
  constexpr int kLevels = 200;
  std::array<double, kLevels> quantiles;
  for (int i = 0; i < kLevels; ++i)
    quantiles[size_t(i)] = quantile(forecast, (i + 0.5) / kLevels).value_or(location(forecast));
  add(truth, location(forecast), log_pdf(forecast, truth), quantiles);
}

void ClassImageScores::add(const Image<float>& probability, const Image<float>& truth) {
  ++images_;
  pixels_ += truth.size();
  for (size_t i = 0; i < truth.size(); ++i) {
    const double d = double(probability.data()[i]) - double(truth.data()[i]);
    square_sum_ += d * d;
  }
  ssim_sum_ += felt::ssim(probability, truth);
  entropy_sum_ += felt::binary_cross_entropy(probability, truth) * double(truth.size());
}

ClassImageScores& ClassImageScores::operator+=(const ClassImageScores& other) {
  images_ += other.images_, pixels_ += other.pixels_;
  square_sum_ += other.square_sum_, ssim_sum_ += other.ssim_sum_, entropy_sum_ += other.entropy_sum_;
  return *this;
}

double ClassImageScores::psnr_db() const { return 10 * std::log10(double(pixels_) / square_sum_); }

double ClassImageScores::ssim() const { return ssim_sum_ / double(images_); }

double psnr_db(const Image<float>& a, const Image<float>& b) {
  assert(a.width() == b.width() && a.height() == b.height());
  double sum = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double d = double(a.data()[i]) - double(b.data()[i]);
    sum += d * d;
  }
  return 10 * std::log10(double(a.size()) / sum);
}

double ssim(const Image<float>& a, const Image<float>& b) {
  assert(a.width() == b.width() && a.height() == b.height());
  constexpr int kWindow = 11;
  constexpr double kSigma = 1.5, kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  std::array<double, kWindow> weight;
  double total = 0;
  for (int i = 0; i < kWindow; ++i) total += weight[i] = std::exp(-0.5 * std::pow((i - kWindow / 2) / kSigma, 2));
  for (double& w : weight) w /= total;
  const int width = a.width() - kWindow + 1, height = a.height() - kWindow + 1;
  if (width <= 0 || height <= 0) return kNone;
  // Weighted moments a, b, aa, bb, ab: along rows, then along columns.
  using Moments = std::array<double, 5>;
  Image<Moments> rows(width, a.height());
  for (int v = 0; v < a.height(); ++v)
    for (int u = 0; u < width; ++u)
      for (int i = 0; i < kWindow; ++i) {
        const double x = a(u + i, v), y = b(u + i, v), w = weight[i];
        Moments& m = rows(u, v);
        m[0] += w * x, m[1] += w * y, m[2] += w * x * x, m[3] += w * y * y, m[4] += w * x * y;
      }
  double sum = 0;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      Moments m{};
      for (int i = 0; i < kWindow; ++i)
        for (int k = 0; k < 5; ++k) m[k] += weight[i] * rows(u, v + i)[k];
      const double var_a = m[2] - m[0] * m[0], var_b = m[3] - m[1] * m[1], covariance = m[4] - m[0] * m[1];
      sum += (2 * m[0] * m[1] + kC1) * (2 * covariance + kC2) /
             ((m[0] * m[0] + m[1] * m[1] + kC1) * (var_a + var_b + kC2));
    }
  return sum / (double(width) * height);
}

double binary_cross_entropy(const Image<float>& probability, const Image<float>& truth) {
  assert(probability.width() == truth.width() && probability.height() == truth.height());
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    const double p = std::clamp(double(probability.data()[i]), 1e-7, 1 - 1e-7), y = truth.data()[i];
    sum -= y * std::log(p) + (1 - y) * std::log(1 - p);
  }
  return sum / double(truth.size());
}

}  // namespace felt
