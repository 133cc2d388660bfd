#include "core/confusion_matrix.h"

#include <cmath>

#include "core/error.h"

namespace felt {

ConfusionMatrix confusion_matrix(std::vector<double> rows, int k, const std::string& where) {
  if (rows.size() != size_t(k) * k)
    throw ConfigError(describe_mismatch(where, "confusion matrix", std::to_string(size_t(k) * k) + " numbers",
                                        std::to_string(rows.size())));
  std::vector<std::string> problems;
  for (int i = 0; i < k; ++i) {
    double sum = 0;
    bool good = true;
    for (int j = 0; j < k; ++j) {
      const double value = rows[size_t(i) * k + j];
      good &= std::isfinite(value) && value >= 0;
      sum += value;
    }
    if (!good || !(sum > 0) || !std::isfinite(sum)) {
      problems.push_back(describe_mismatch(where, "row " + std::to_string(i + 1),
                                           "finite numbers >= 0 with a positive sum",
                                           good ? "the sum " + std::to_string(sum) : "a number that is not"));
      continue;
    }
    for (int j = 0; j < k; ++j) rows[size_t(i) * k + j] /= sum;
  }
  if (!problems.empty()) throw ConfigError(problems);
  return {k, std::move(rows)};
}

std::vector<double> true_class_given(const ConfusionMatrix& confusion, std::span<const double> class_share,
                                     int predicted_slot) {
  std::vector<double> posterior(confusion.k);
  double sum = 0;
  for (int i = 0; i < confusion.k; ++i) sum += posterior[i] = class_share[i] * confusion(i, predicted_slot);
  for (double& p : posterior) p = sum > 0 ? p / sum : 1.0 / confusion.k;
  return posterior;
}

}  // namespace felt
