#include "inference/dirichlet.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>
#include <vector>

#include "inference/special_functions.h"

namespace felt {
namespace {

constexpr int kMaxNewtonSteps = 100;
constexpr double kRelativeStep = 1e-14;

}  // namespace

double total_concentration(std::span<const double> a) { return std::accumulate(a.begin(), a.end(), 0.0); }

void project_dirichlet_kl(std::span<const double> a, std::span<const double> r, std::span<double> out) {
  assert(!a.empty() && a.size() == r.size() && a.size() == out.size());
  const size_t k = a.size();
  if (k == 1) {
    out[0] = a[0] + 1;
    return;
  }
  // Unknown: delta_i = out_i - a_i. Residual, with digamma(a+1) = digamma(a) + 1/a:
  //   [digamma(a_i + delta_i) - digamma(a_i)] - [digamma(A + sum delta) - digamma(A + 1)] - r_i/a_i
  const double total = total_concentration(a);
  std::vector<double> delta(k), residual(k), inverse_diagonal(k);
  // Exact for r_i = 1, and to first order for small and for large a_i.
  for (size_t i = 0; i < k; ++i) delta[i] = a[i] * r[i] / (a[i] + (1 - r[i]));
  for (int step = 0; step < kMaxNewtonSteps; ++step) {
    const double delta_total = std::accumulate(delta.begin(), delta.end(), 0.0);
    const double of_total = digamma_difference(total + 1, delta_total - 1);
    double sum_gd = 0, sum_d = 0;
    for (size_t i = 0; i < k; ++i) {
      residual[i] = digamma_difference(a[i], delta[i]) - of_total - r[i] / a[i];
      inverse_diagonal[i] = 1 / trigamma(a[i] + delta[i]);
      sum_gd += residual[i] * inverse_diagonal[i];
      sum_d += inverse_diagonal[i];
    }
    // Sherman-Morrison for diag(trigamma(out_i)) - trigamma(sum out) 1 1^T.
    const double coupling = sum_gd / (1 / trigamma(total + delta_total) - sum_d);
    double scale = 1, largest = 0;
    for (size_t i = 0; i < k; ++i) {
      const double move = -(residual[i] + coupling) * inverse_diagonal[i];
      residual[i] = move;
      while (a[i] + delta[i] + scale * move <= 0) scale /= 2;
    }
    for (size_t i = 0; i < k; ++i) {
      delta[i] += scale * residual[i];
      largest = std::max(largest, std::abs(scale * residual[i]) / (a[i] + delta[i]));
    }
    if (largest < kRelativeStep) break;
  }
  for (size_t i = 0; i < k; ++i) out[i] = a[i] + delta[i];
}

void project_dirichlet_published(std::span<const double> a, std::span<const double> r, std::span<const double> not_r,
                                 std::span<double> out) {
  assert(!a.empty() && a.size() == r.size() && a.size() == not_r.size() && a.size() == out.size());
  const size_t k = a.size();
  if (k == 1) {
    out[0] = a[0] + 1;
    return;
  }
  const double total = total_concentration(a);
  const size_t dominant = size_t(std::max_element(a.begin(), a.end()) - a.begin());
  double others_of_dominant = 0;
  for (size_t i = 0; i < k; ++i) others_of_dominant += i == dominant ? 0 : a[i];
  for (size_t i = 0; i < k; ++i) {
    // a^ = E[w] (E[w] - E[w^2]) / (E[w^2] - E[w]^2), numerator and denominator as sums of positive terms.
    const double own = a[i], others = i == dominant ? others_of_dominant : total - a[i];
    const double x = own + r[i];
    const double numerator = own * others + own * not_r[i] + others * r[i];
    const double denominator = x * (others + not_r[i]) + r[i] * not_r[i] * (total + 1);
    out[i] = x * numerator / denominator;
  }
}

}  // namespace felt
