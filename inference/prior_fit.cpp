#include "inference/prior_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "inference/material.h"

namespace felt {
namespace {

double normal_cdf(double z) { return 0.5 * std::erfc(-z / std::numbers::sqrt2); }

double kolmogorov_distance(std::vector<double> values, double mean, double sd) {
  std::sort(values.begin(), values.end());
  double distance = 0;
  const double n = double(values.size());
  for (size_t i = 0; i < values.size(); ++i) {
    const double p = normal_cdf((values[i] - mean) / sd);
    distance = std::max({distance, double(i + 1) / n - p, p - double(i) / n});
  }
  return distance;
}

}  // namespace

std::optional<PriorFit> fit_prior(const GroupedReadings& groups, double max_nu_0, std::optional<double> rho_elsewhere) {
  PriorFit fit;
  std::vector<double> all;
  double within_squares = 0, sum_of_squared_sizes = 0;
  std::vector<ReadingStatistics> each;
  for (const std::vector<double>& group : groups) {
    if (group.empty()) continue;
    each.push_back(statistics_of(group));
    within_squares += each.back().m2;
    sum_of_squared_sizes += each.back().n * each.back().n;
    all.insert(all.end(), group.begin(), group.end());
  }
  fit.readings = all.size();
  fit.groups = each.size();
  const ReadingStatistics total = statistics_of(all);
  if (fit.readings < 2 || !(total.m2 > 0)) return std::nullopt;
  fit.mean = total.mean;

  const double n = total.n, g = double(fit.groups);
  double variance = total.m2 / (n - 1);
  fit.effective_readings = n;
  if (fit.groups >= 2 && fit.readings > fit.groups) {
    double between_squares = 0;
    for (const ReadingStatistics& s : each) between_squares += s.n * (s.mean - fit.mean) * (s.mean - fit.mean);
    const double within = within_squares / (n - g);
    const double size = (n - sum_of_squared_sizes / n) / (g - 1);
    const double between = std::max(0.0, (between_squares / (g - 1) - within) / size);
    variance = between + within;
    // rho = 1 (groups without any spread of their own) is outside what the model allows.
    fit.rho = std::min(between / variance, 0.999);
    // Variance of the grand mean is (sigma^2/n) (1 + (sum n_j^2/n - 1) rho).
    fit.effective_readings = n / (1 + (sum_of_squared_sizes / n - 1) * *fit.rho);
  } else if (fit.groups == 1 && rho_elsewhere) {
    fit.assumed_rho = rho_elsewhere;
    variance /= 1 - *rho_elsewhere;
    fit.effective_readings = n / (1 + (n - 1) * *rho_elsewhere);
  }
  fit.sd = std::sqrt(variance);
  fit.nu_0 = std::min(fit.effective_readings, max_nu_0);
  fit.ks_distance = kolmogorov_distance(std::move(all), fit.mean, fit.sd);
  fit.normal_is_plausible = fit.ks_distance < 0.886 / std::sqrt(fit.effective_readings);
  return fit;
}

std::optional<double> pooled_rho(std::span<const PriorFit> fits) {
  double weight = 0, sum = 0;
  for (const PriorFit& fit : fits) {
    if (!fit.rho) continue;
    weight += double(fit.groups - 1);
    sum += double(fit.groups - 1) * *fit.rho;
  }
  return weight > 0 ? std::optional(sum / weight) : std::nullopt;
}

double confusion_after_one_touch(const Nig& a, const Nig& b) {
  const StudentT ta = predictive(a), tb = predictive(b);
  // Wide of both, in u with x = centre + width sinh(u): the trapezoidal rule on a continuous integrand with kinks.
  const double centre = 0.5 * (ta.location + tb.location);
  const double width = std::min(std::sqrt(ta.scale2), std::sqrt(tb.scale2)) + 0.5 * std::abs(ta.location - tb.location);
  const double reach = std::asinh(1e6 * (std::sqrt(ta.scale2) + std::sqrt(tb.scale2) + width) / width);
  constexpr int kSteps = 8000;
  const double step = 2 * reach / kSteps;
  double overlap = 0;
  for (int i = 0; i <= kSteps; ++i) {
    const double u = -reach + i * step, x = centre + width * std::sinh(u);
    overlap += std::min(pdf(ta, x), pdf(tb, x)) * width * std::cosh(u) * step;
  }
  return std::min(0.5, 0.5 * overlap);
}

}  // namespace felt
