#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace felt {

/// P(predicted class | true class) of a segmentation network, over class slots. Plain data: row-major, one row a true
/// class, each row sums to 1.
struct ConfusionMatrix {
  int k = 0;
  std::vector<double> p;  ///< k * k

  double operator()(int true_slot, int predicted_slot) const { return p[size_t(true_slot) * k + predicted_slot]; }
  std::span<const double> row(int true_slot) const { return {p.data() + size_t(true_slot) * k, size_t(k)}; }
  bool operator==(const ConfusionMatrix&) const = default;
};

/// Rows of counts or shares, each divided by its sum. Throws ConfigError (prefix `where`) naming every row that holds a
/// negative or non-finite number or sums to zero, and where there are not k * k numbers.
ConfusionMatrix confusion_matrix(std::vector<double> rows, int k, const std::string& where);

/// P(true class | predicted class) for a share of each true class, by Bayes' rule. Uniform over the classes where
/// nothing is ever predicted as `predicted_slot`.
std::vector<double> true_class_given(const ConfusionMatrix& confusion, std::span<const double> class_share,
                                     int predicted_slot);

}  // namespace felt
