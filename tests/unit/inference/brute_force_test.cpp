// The touch models against enumerations that share no formula with them beyond Bayes' rule.
#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <random>

#include "inference/dirichlet.h"
#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/noise.h"
#include "inference/priors.h"
#include "tests/support/mixture_brute_force.h"

namespace felt {
namespace {

using test::exact_predictive;
using test::mixture_settings;
using test::MixtureSetting;

// ln N(psi; tau, S) with S built entry by entry.
double log_normal(const Nig& p, double sigma2, const std::vector<double>& psi, const std::vector<double>& noise,
                  double rho) {
  const Eigen::Index n = Eigen::Index(psi.size());
  Eigen::MatrixXd s(n, n);
  Eigen::VectorXd x(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    x(i) = psi[size_t(i)] - p.tau;
    for (Eigen::Index j = 0; j < n; ++j) s(i, j) = sigma2 * ((i == j ? 1 : rho) + 1 / p.kappa);
    s(i, i) += noise[size_t(i)] * noise[size_t(i)];
  }
  const Eigen::LLT<Eigen::MatrixXd> factor(s);
  double log_determinant = 0;
  for (Eigen::Index i = 0; i < n; ++i) log_determinant += 2 * std::log(factor.matrixL()(i, i));
  return -0.5 * (x.dot(factor.solve(x)) + log_determinant + double(n) * std::log(2 * std::numbers::pi));
}

// ln p(psi | class): the normal above, averaged over the Gamma prior of the precision by quadrature in ln lambda.
double log_evidence_by_enumeration(const Nig& p, const std::vector<double>& psi, const std::vector<double>& noise,
                                   double rho) {
  const auto log_weight = [&](double t) {
    const double lambda = std::exp(t);
    return p.beta * std::log(p.gamma) - std::lgamma(p.beta) + p.beta * t - p.gamma * lambda +
           log_normal(p, 1 / lambda, psi, noise, rho);
  };
  const double centre = std::log(p.beta / p.gamma);
  double peak = -1e300;
  for (double t = centre - 12; t < centre + 4; t += 0.05) peak = std::max(peak, log_weight(t));
  // The trapezoidal rule converges exponentially for integrands that vanish on both sides.
  double sum = 0;
  constexpr double kStep = 0.02;
  for (double t = centre - 12; t < centre + 4; t += kStep) sum += kStep * std::exp(log_weight(t) - peak);
  return peak + std::log(sum);
}

struct ReadRegion {
  std::vector<double> belief, psi, noise;
  std::vector<Nig> prior;
};

ReadRegion random_region(std::mt19937& rng, int readings, double noise_scale) {
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform;
  ReadRegion r;
  for (int c = 0; c < 3; ++c) {
    r.belief.push_back(0.1 + uniform(rng));
    const double nu = 2 + 60 * uniform(rng);
    r.prior.push_back(calibrated_prior(0.4 + 0.2 * normal(rng), 0.05 + 0.1 * uniform(rng), nu));
  }
  for (int i = 0; i < readings; ++i) {
    r.psi.push_back(0.4 + 0.2 * normal(rng));
    r.noise.push_back(noise_scale * uniform(rng));
  }
  return r;
}

}  // namespace

TEST_CASE("the material posterior is the enumeration over the region's class, to rounding") {
  std::mt19937 rng(21);
  double worst = 0;
  for (int i = 0; i < 12; ++i) {
    const ReadRegion r = random_region(rng, 1 + i % 8, 0);
    const double rho = 0.19 * (i % 6);
    const MaterialPosterior found = material_posterior(r.belief, r.prior, r.psi, r.noise, rho);
    std::vector<double> weight;
    double total = 0, prior_total = 0;
    for (size_t c = 0; c < r.prior.size(); ++c) {
      weight.push_back(r.belief[c] * std::exp(log_evidence_by_enumeration(r.prior[c], r.psi, r.noise, rho)));
      total += weight[c];
      prior_total += r.belief[c];
    }
    for (size_t c = 0; c < r.prior.size(); ++c)
      worst = std::max(worst, std::abs(found.belief.p[c] - weight[c] / total));
    worst = std::max(worst, std::abs(found.belief.log_evidence - std::log(total / prior_total)));
  }
  CHECK(worst < 1e-10);
}

TEST_CASE(
    "several noisy correlated readings: quadrature agrees with the enumeration, and the next reading with Bayes' "
    "rule") {
  std::mt19937 rng(22);
  double worst = 0;
  for (int i = 0; i < 8; ++i) {
    ReadRegion r = random_region(rng, 1 + i % 5, 0.3);
    const double rho = 0.2 * (i % 5);
    for (const Nig& p : r.prior) {
      const MaterialClass found = quadrature_material_class(p, r.psi, r.noise, rho);
      worst = std::max(worst, std::abs(found.log_evidence - log_evidence_by_enumeration(p, r.psi, r.noise, rho)));
      // p(next | psi) = p(psi, next)/p(psi), at a few points against the Student-t that stands for it.
      for (double z : {-1.0, 0.0, 1.5}) {
        const double next = found.next_here.location + z * std::sqrt(found.next_here.scale2);
        std::vector<double> psi = r.psi, noise = r.noise;
        psi.push_back(next);
        noise.push_back(0);
        const double joint = log_evidence_by_enumeration(p, psi, noise, rho);
        CHECK(joint - found.log_evidence == Approx(log_pdf(found.next_here, next)).margin(0.05));
      }
    }
  }
  CHECK(worst < 1e-9);
}

TEST_CASE("the exact next reading of a material is the ratio of its evidences") {
  std::mt19937 rng(23);
  for (int i = 0; i < 20; ++i) {
    ReadRegion r = random_region(rng, 1 + i % 6, 0);
    const double rho = 0.19 * (i % 6), next = 0.45;
    const MaterialClass before = material_class(r.prior[0], statistics_of(r.psi), rho);
    std::vector<double> more = r.psi;
    more.push_back(next);
    const MaterialClass after = material_class(r.prior[0], statistics_of(more), rho);
    CHECK(log_pdf(before.next_here, next) == Approx(after.log_evidence - before.log_evidence).epsilon(1e-10));
  }
}

TEST_CASE(
    "one mixture reading: the exact predictive over assignments is reproduced by responsibilities and posteriors") {
  const std::vector<double> a{3, 1};
  const std::vector<Nig> prior{{0.2, 4, 3, 0.02}, {0.5, 2, 5, 0.1}};
  const ClassPosterior r = responsibilities(a, prior, 0.4);
  const StudentTMixture exact = exact_predictive(a, prior, {0.4});
  for (double x : {0.1, 0.35, 0.7}) {
    double density = 0;
    for (size_t j = 0; j < 2; ++j) {
      for (size_t c = 0; c < 2; ++c) {
        const Nig block = c == j ? conjugate_update(prior[c], 0.4) : prior[c];
        density += r.p[j] * (a[c] + (c == j)) / 5 * pdf(predictive(block), x);
      }
    }
    CHECK(pdf(exact, x) == Approx(density).epsilon(1e-12));
  }
}

TEST_CASE("over sequences of touches the KL projection stays nearer to the exact predictive than the published one") {
  constexpr int kRuns = 12;
  for (const MixtureSetting& setting : mixture_settings()) {
    const auto [kl, published] = test::projection_errors(setting, kRuns);
    INFO(setting.name << ": mean KL " << kl.mean_divergence << " (kl), " << published.mean_divergence
                      << " (published), runs with a refused update " << published.invalid_runs << " of " << kRuns);
    CHECK(kl.invalid_runs == 0);
    CHECK(kl.mean_divergence < published.mean_divergence);
    CHECK(kl.mean_divergence > 0);
    CHECK(kl.mean_divergence < 0.1);
  }
}

}  // namespace felt
