#include "inference/dirichlet.h"

#include <algorithm>
#include <boost/math/special_functions/polygamma.hpp>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "inference/special_functions.h"

namespace felt {
namespace {

constexpr int kMaxNewtonSteps = 100;
constexpr double kRelativeStep = 1e-14;

/// Relative error of a result, as its terms round, from which on it counts as undetermined.
constexpr double kMostRounding = 1e-6;

/// Polygammas of concentrations from here to the inverse stay within doubles.
constexpr double kLeast = 1e-75;

/// Below this share of the largest number the sum of the others counts as a small step.
constexpr double kDominated = 1e-4;

/// Sum of positive numbers, and for each of them the sum of the others without cancellation.
class SumOfOthers {
public:
  explicit SumOfOthers(std::span<const double> x)
      : x_(x), largest_(size_t(std::max_element(x.begin(), x.end()) - x.begin())) {
    for (size_t i = 0; i < x.size(); ++i) rest_ += i == largest_ ? 0 : x[i];
  }
  size_t largest() const { return largest_; }
  double sum() const { return x_[largest_] + rest_; }
  double others(size_t i) const { return i == largest_ ? rest_ : sum() - x_[i]; }

private:
  std::span<const double> x_;
  size_t largest_;
  double rest_ = 0;
};

/// d/dx of 1/trigamma(x): from 2 x (x -> 0) to 1 (x -> infinity).
double inverse_trigamma_slope(double x) {
  const double t = trigamma(x);
  return -boost::math::polygamma(2, x) / t / t;
}

/// x - 1/trigamma(x): from x (x -> 0) to 1/2 (x -> infinity).
double trigamma_excess(double x) {
  const double c = log_minus_digamma_slope(x);
  return x / (x + c) * c;
}

/// 1/trigamma(sum x) - sum 1/trigamma(x_i) > 0, the denominator of the rank-one step: about the sum of all x_i but the
/// largest, formed without the two large sums whose difference it is.
double rank_one_denominator(std::span<const double> x, const SumOfOthers& sum) {
  const size_t d = sum.largest();
  const double s = sum.sum(), rest = sum.others(d);
  const bool dominated = rest < kDominated * x[d];
  const auto over_others = [&](auto f) {
    double total = 0;
    for (size_t i = 0; i < x.size(); ++i) total += i == d ? 0 : f(x[i]);
    return total;
  };
  if (s < 1) {
    const double of_largest =
        dominated ? rest * inverse_trigamma_slope(x[d] + rest / 2) : 1 / trigamma(s) - 1 / trigamma(x[d]);
    return of_largest - over_others([](double y) { return 1 / trigamma(y); });
  }
  const double of_largest =
      dominated ? rest * (1 - inverse_trigamma_slope(x[d] + rest / 2)) : trigamma_excess(s) - trigamma_excess(x[d]);
  return over_others(trigamma_excess) - of_largest;
}

/// Newton for digamma(out_i) - digamma(S) = E[ln w_i], S = sum out. Unknown: delta_i = out_i - a_i. The residual is
/// formed from the smaller of two sets of terms, with digamma(a+1) = digamma(a) + 1/a. Where a class holds nearly all:
///   [digamma(A + 1) - digamma(a_i + 1)] + (1 - r_i)/a_i - [digamma(S) - digamma(out_i)]
/// and for large concentrations:
///   [digamma(a_i + delta_i) - digamma(a_i)] - [digamma(S) - digamma(A + 1)] - r_i/a_i
class DirichletNewton {
public:
  DirichletNewton(std::span<const double> a, std::span<const double> r, std::span<const double> not_r)
      : a_(a),
        r_(r),
        x_(a.size()),
        delta_(a.size()),
        minus_log_w_(a.size()),
        inverse_slope_(a.size()),
        move_(a.size()) {
    const SumOfOthers sum_a(a);
    total_ = sum_a.sum();
    for (size_t i = 0; i < a.size(); ++i) {
      minus_log_w_[i] = digamma_difference(a[i] + 1, sum_a.others(i)) + not_r[i] / a[i];
      // Exact for r_i = 1, and to first order for small and for large a_i.
      delta_[i] = r[i] * (a[i] / (a[i] + not_r[i]));
      x_[i] = a[i] + delta_[i];
    }
  }

  const std::vector<double>& result() const { return x_; }

  /// Whether rounding leaves digits of the result.
  bool determined() const { return computable() && largest_move_ < kMostRounding && rounding_ < kMostRounding; }

  /// Whether another step has a meaning.
  bool unfinished() const { return computable() && largest_move_ >= kRelativeStep; }

  void step() {
    find_moves();
    double scale = 1;
    for (size_t i = 0; i < x_.size(); ++i)
      while (x_[i] + scale * move_[i] <= 0) scale /= 2;
    largest_move_ = 0;
    for (size_t i = 0; i < x_.size(); ++i) {
      const double move = scale * move_[i];
      largest_move_ = std::max(largest_move_, std::abs(move) / x_[i]);
      delta_[i] += move;
      x_[i] = std::abs(delta_[i]) < a_[i] / 2 ? a_[i] + delta_[i] : x_[i] + move;
    }
  }

private:
  bool computable() const {
    return std::all_of(x_.begin(), x_.end(), [](double y) { return y > kLeast && y < 1 / kLeast; });
  }

  /// Sherman-Morrison for the Hessian diag(trigamma(out_i)) - trigamma(S) 1 1^T.
  void find_moves() {
    const SumOfOthers sum(x_);
    const double of_total = total_ < 1 ? digamma(sum.sum()) - digamma(total_ + 1)
                                       : digamma_difference(total_ + 1, total_concentration(delta_) - 1);
    double sum_moves = 0, sum_terms = 0;
    for (size_t i = 0; i < x_.size(); ++i) {
      const double moved = digamma_difference(a_[i], delta_[i]), gained = r_[i] / a_[i];
      const double largest_term = std::max({std::abs(moved), std::abs(of_total), gained});
      const bool near_prior = largest_term < minus_log_w_[i];
      const double residual =
          near_prior ? moved - of_total - gained : minus_log_w_[i] - digamma_difference(x_[i], sum.others(i));
      inverse_slope_[i] = 1 / trigamma(x_[i]);
      move_[i] = -residual * inverse_slope_[i];
      sum_moves += move_[i];
      sum_terms += (near_prior ? largest_term : minus_log_w_[i]) * inverse_slope_[i];
    }
    const double denominator = rank_one_denominator(x_, sum);
    rounding_ = std::numeric_limits<double>::epsilon() * sum_terms / denominator;
    for (size_t i = 0; i < x_.size(); ++i) move_[i] += sum_moves / denominator * inverse_slope_[i];
  }

  std::span<const double> a_, r_;
  std::vector<double> x_, delta_, minus_log_w_, inverse_slope_, move_;
  double total_ = 0;
  double largest_move_ = std::numeric_limits<double>::infinity();  ///< of the last step, relative
  double rounding_ = 0;  ///< of the last step: relative error of the result as the terms round
};

}  // namespace

double total_concentration(std::span<const double> a) { return std::accumulate(a.begin(), a.end(), 0.0); }

void project_dirichlet_kl(std::span<const double> a, std::span<const double> r, std::span<const double> not_r,
                          std::span<double> out) {
  assert(!a.empty() && a.size() == r.size() && a.size() == not_r.size() && a.size() == out.size());
  const size_t k = a.size();
  if (k == 1) {
    out[0] = a[0] + 1;
    return;
  }
  const auto in_range = [](double y) { return y >= kLeastConcentration && y <= kMostConcentration; };
  if (!std::all_of(a.begin(), a.end(), in_range)) {
    std::fill(out.begin(), out.end(), std::numeric_limits<double>::quiet_NaN());
    return;
  }
  DirichletNewton newton(a, r, not_r);
  for (int step = 0; step < kMaxNewtonSteps && newton.unfinished(); ++step) newton.step();
  if (newton.determined())
    std::copy(newton.result().begin(), newton.result().end(), out.begin());
  else
    std::fill(out.begin(), out.end(), std::numeric_limits<double>::quiet_NaN());
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
