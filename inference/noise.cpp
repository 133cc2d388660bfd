#include "inference/noise.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>
#include <boost/math/special_functions/gamma.hpp>
#include <cassert>
#include <cmath>
#include <numbers>
#include <numeric>
#include <vector>

#include "inference/special_functions.h"

namespace felt {
namespace {

using Rule = boost::math::quadrature::gauss<double, 20>;

// Panels whose integrand stays below e^-kNegligible of the largest are left out.
constexpr double kNegligible = 45.0;

// Readings with noise of one size, as an update sees them: about the prior location.
struct EquallyNoisy {
  double noise2 = 0, n = 0, mean = 0, m2 = 0;
};

std::vector<EquallyNoisy> by_noise(double tau, std::span<const double> psi, std::span<const double> noise_sd) {
  std::vector<size_t> order(psi.size());
  std::iota(order.begin(), order.end(), size_t(0));
  std::stable_sort(order.begin(), order.end(), [&](size_t i, size_t j) { return noise_sd[i] < noise_sd[j]; });
  std::vector<EquallyNoisy> groups;
  for (size_t k = 0; k < order.size(); ++k) {
    const size_t i = order[k];
    if (k == 0 || noise_sd[i] != noise_sd[order[k - 1]]) groups.push_back({noise_sd[i] * noise_sd[i], 0, 0, 0});
    EquallyNoisy& g = groups.back();
    const double d = psi[i] - tau, step = d - g.mean;
    g.n += 1;
    g.mean += step / g.n;
    g.m2 += step * (d - g.mean);
  }
  return groups;
}

// One class, several noisy readings, as a function of t = ln(lambda / (beta/gamma)).
class PrecisionPosterior {
public:
  PrecisionPosterior(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd, double rho)
      : prior_(prior),
        psi_(psi),
        noise_sd_(noise_sd),
        readings_(by_noise(prior.tau, psi, noise_sd)),
        rho_(rho),
        plug_in_precision_(prior.beta / prior.gamma) {
    // Gamma(lambda; beta, gamma) d lambda = exp(constant + beta (t - e^t)) dt
    log_normaliser_ = prior.beta * std::log(prior.beta) - boost::math::lgamma(prior.beta) -
                      0.5 * double(psi.size()) * std::log(2 * std::numbers::pi);
  }

  // Moments of mu and of the region's own mean given lambda, all about the prior location.
  struct Given {
    double log_density = 0;  // ln of prior density times likelihood, per unit of t
    double lambda = 0;
    double mean_shift = 0;     // E[mu] - tau
    double mean_variance = 0;  // Var[mu]
    double region_shift = 0;   // E[region's mean] - tau
    double region_variance = 0;
  };

  Given at(double t) const {
    Given g;
    g.lambda = plug_in_precision_ * std::exp(t);
    const double sigma2 = 1 / g.lambda, unshared = (1 - rho_) * sigma2;
    double precision = 0, weighted = 0, log_determinant = 0;
    for (const EquallyNoisy& r : readings_) {
      const double own = unshared + r.noise2;
      precision += r.n / own;
      weighted += r.n * r.mean / own;
      log_determinant += r.n * std::log(own);
    }
    const double mean = weighted / precision;
    double squares = 0;
    for (const EquallyNoisy& r : readings_) {
      const double d = r.mean - mean;
      squares += (r.m2 + r.n * d * d) / (unshared + r.noise2);
    }
    const double common = (rho_ + 1 / prior_.kappa) * sigma2;
    squares += mean * mean * precision / (1 + common * precision);
    log_determinant += std::log1p(common * precision);

    const double mean_data_variance = rho_ * sigma2 + 1 / precision;
    g.mean_variance = 1 / (prior_.kappa * g.lambda + 1 / mean_data_variance);
    g.mean_shift = mean * g.mean_variance / mean_data_variance;
    g.region_variance = 1 / (1 / common + precision);
    g.region_shift = mean * g.region_variance * precision;
    g.log_density = log_normaliser_ + prior_.beta * (t - std::exp(t)) - 0.5 * (log_determinant + squares);
    return g;
  }

  // Left of this the density falls towards -infinity, right of `highest_mode` towards +infinity.
  double lowest_mode() const {
    double largest = 0;
    for (size_t i = 0; i < psi_.size(); ++i) {
      const double d = psi_[i] - prior_.tau;
      largest = std::max(largest, d * d + noise_sd_[i] * noise_sd_[i]);
    }
    return std::min(0.0, -std::log(largest * plug_in_precision_)) - 2;
  }
  double highest_mode() const { return std::log1p(double(psi_.size()) / (2 * prior_.beta)); }
  // Three times the least standard deviation that the density can have: a Gaussian across as much is a polynomial to
  // the rule's twenty nodes.
  double panel_width() const { return 3 / std::sqrt(prior_.beta + 0.5 * double(psi_.size())); }
  double plug_in_precision() const { return plug_in_precision_; }

private:
  Nig prior_;
  std::span<const double> psi_, noise_sd_;
  std::vector<EquallyNoisy> readings_;
  double rho_, plug_in_precision_, log_normaliser_ = 0;
};

// Left edges of the panels that matter, all `width` wide, and the largest log density seen.
struct Panels {
  std::vector<double> left;
  double width = 0;
  double peak = 0;
};

constexpr size_t kMostPanels = 1'000'000;  // thousands of times what sound priors and readings take

Panels choose_panels(const PrecisionPosterior& posterior) {
  const double width = posterior.panel_width();
  std::vector<double> edge, value;
  double peak = posterior.at(0).log_density;
  const auto march = [&](double from, double step, double last_mode) {
    for (double t = from;; t += step) {
      const double v = posterior.at(t).log_density;
      edge.push_back(t);
      value.push_back(v);
      peak = std::max(peak, v);
      // Beyond what numbers can hold there is no density to find.
      if (std::isnan(v) || edge.size() > kMostPanels) break;
      if (v < peak - kNegligible && (step < 0 ? t < last_mode : t > last_mode)) break;
    }
  };
  march(-width, -width, posterior.lowest_mode());
  std::reverse(edge.begin(), edge.end());
  std::reverse(value.begin(), value.end());
  march(0, width, posterior.highest_mode());
  Panels panels{{}, width, peak};
  for (size_t i = 0; i + 1 < edge.size(); ++i) {
    if (std::max(value[i], value[i + 1]) > peak - kNegligible) panels.left.push_back(edge[i]);
  }
  return panels;
}

// Calls f(weight, given) at every node; weights are scaled by e^-peak.
template <class F>
void for_each_node(const PrecisionPosterior& posterior, const Panels& panels, F f) {
  const double half = panels.width / 2;
  for (double left : panels.left) {
    for (size_t i = 0; i < Rule::abscissa().size(); ++i) {
      for (double side : {-1.0, 1.0}) {
        const auto given = posterior.at(left + half + side * half * Rule::abscissa()[i]);
        f(half * Rule::weights()[i] * std::exp(given.log_density - panels.peak), given);
      }
    }
  }
}

// Weighted mean and sum of squares about it, in one pass.
struct Spread {
  double weight = 0, mean = 0, squares = 0;
  void add(double w, double x) {
    if (w == 0) return;
    weight += w;
    const double d = x - mean;
    mean += d * w / weight;
    squares += w * d * (x - mean);
  }
};

}  // namespace

MaterialClass tempered_material_class(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd,
                                      double rho) {
  assert(!psi.empty() && psi.size() == noise_sd.size());
  // Noise in units of the class's variance leaves the model conjugate: psi_i has variance sigma^2 (1-rho)/w_i of its
  // own.
  const double v = plug_in_variance(prior), within = 1 - rho, n = double(psi.size());
  double weight = 0, mean = 0, log_weights = 0;
  for (size_t i = 0; i < psi.size(); ++i) {
    const double w = within * v / (within * v + noise_sd[i] * noise_sd[i]);
    weight += w;
    mean += (psi[i] - prior.tau - mean) * w / weight;
    log_weights += std::log(w);
  }
  double squares = 0, class_squares = 0;  // the latter: only the share of each square that the class explains
  for (size_t i = 0; i < psi.size(); ++i) {
    const double w = within * v / (within * v + noise_sd[i] * noise_sd[i]);
    const double d = psi[i] - prior.tau - mean;
    squares += w * d * d / within;
    class_squares += w * w * d * d / within;
  }
  const double n_effective = weight / (within + weight * rho);
  const double mean_share = n_effective * (1 + (n - 1) * rho) / n;  // of the mean's variance, the class's part
  const double kappa = prior.kappa + n_effective;
  const double mean_square = prior.kappa * n_effective * mean * mean / kappa;

  MaterialClass result;
  result.posterior = {prior.tau + n_effective * mean / kappa, kappa,
                      prior.beta + 0.5 * (weight * (n - 1) / n + mean_share),
                      prior.gamma + 0.5 * (class_squares + mean_share * mean_square)};
  result.log_evidence = log_gamma_difference(prior.beta, n / 2) -
                        (prior.beta + n / 2) * std::log1p(0.5 * (squares + mean_square) / prior.gamma) -
                        0.5 * (std::log1p(n_effective / prior.kappa) + n * std::log(within) - log_weights +
                               std::log1p(rho * weight / within) + n * std::log(2 * std::numbers::pi * prior.gamma));
  const double common = rho + 1 / prior.kappa, pull = weight * common / (within + weight * common);
  result.next_here = {prior.tau + pull * mean,
                      plug_in_variance(result.posterior) * (within + within * common / (within + weight * common)),
                      2 * result.posterior.beta};
  return result;
}

MaterialClass quadrature_material_class(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd,
                                        double rho) {
  assert(!psi.empty() && psi.size() == noise_sd.size());
  const PrecisionPosterior posterior(prior, psi, noise_sd, rho);
  const Panels panels = choose_panels(posterior);
  double mass = 0, precision = 0, log_precision = 0, mean_variance = 0, region_variance = 0;
  Spread shift, region;
  for_each_node(posterior, panels, [&](double w, const PrecisionPosterior::Given& g) {
    const double by_precision = w * g.lambda;
    mass += w;
    precision += by_precision;
    log_precision += w * std::log(g.lambda / posterior.plug_in_precision());
    shift.add(by_precision, g.mean_shift);
    region.add(by_precision, g.region_shift);
    mean_variance += by_precision * g.mean_variance;
    region_variance += by_precision * g.region_variance;
  });
  const double inverse_kappa = mean_variance + shift.squares, next_spread = region_variance + region.squares;
  precision /= mass;
  const double beta =
      inverse_log_minus_digamma(std::log(precision / posterior.plug_in_precision()) - log_precision / mass);
  const Nig nig{prior.tau + shift.mean, mass / inverse_kappa, beta, beta / precision};
  return {panels.peak + std::log(mass),
          nig,
          {prior.tau + region.mean, plug_in_variance(nig) * (1 - rho + next_spread / mass), 2 * beta}};
}

bool needs_quadrature(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd) {
  if (psi.size() > 1 || prior.beta < 1.5) return true;
  const double v = plug_in_variance(prior), noise2 = noise_sd[0] * noise_sd[0], d = psi[0] - prior.tau;
  const double z2 = d * d / (v * (1 + 1 / prior.kappa) + noise2);
  return noise2 * (1 + z2) * (1 + z2) > v / 3;
}

MaterialClass noisy_material_class(const Nig& prior, std::span<const double> psi, std::span<const double> noise_sd,
                                   double rho) {
  if (std::all_of(noise_sd.begin(), noise_sd.end(), [](double s) { return s == 0; })) {
    return material_class(prior, statistics_of(psi), rho);
  }
  // Such a prior knows its precision to a thousandth: readings are Gaussian, for which tempering is exact as long as
  // none lies hundreds of spreads away, and the density over the precision is too narrow for panels.
  constexpr double kKnownPrecision = 1e6;
  const auto by = prior.beta <= kKnownPrecision && needs_quadrature(prior, psi, noise_sd) ? quadrature_material_class
                                                                                          : tempered_material_class;
  return by(prior, psi, noise_sd, rho);
}

NoisyReading noisy_update(const Nig& prior, double psi, double noise_sd) {
  if (noise_sd == 0) return {log_evidence(prior, psi), conjugate_update(prior, psi)};
  const MaterialClass c = noisy_material_class(prior, {&psi, 1}, {&noise_sd, 1}, 0);
  return {c.log_evidence, c.posterior};
}

}  // namespace felt
