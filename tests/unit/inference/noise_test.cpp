#include "inference/noise.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

namespace felt {
namespace {

struct Difference {
  double log_evidence, tau, log_lambda;
  bool by_quadrature;
};

// Closed form less quadrature for one reading z predictive standard deviations from tau; class variance 1.
Difference closed_form_error(double beta, double kappa, double ratio, double z) {
  const Nig prior{0, kappa, beta, beta};
  const double noise = std::sqrt(ratio), psi = z * std::sqrt(1 + 1 / kappa + ratio);
  const MaterialClass closed = tempered_material_class(prior, {&psi, 1}, {&noise, 1}, 0.5);
  const MaterialClass exact = quadrature_material_class(prior, {&psi, 1}, {&noise, 1}, 0.5);
  return {closed.log_evidence - exact.log_evidence, closed.posterior.tau - exact.posterior.tau,
          std::log(plug_in_variance(exact.posterior) / plug_in_variance(closed.posterior)),
          needs_quadrature(prior, {&psi, 1}, {&noise, 1})};
}

}  // namespace

TEST_CASE("the closed form for noise is used only where it errs little; elsewhere quadrature is") {
  double worst_outside = 0;
  for (double beta : {0.01, 0.1, 0.5, 1.0, 2.5, 25.0, 250.0}) {
    for (double kappa : {0.1, 1.0, 50.0}) {
      for (double z : {0.0, 1.0, 3.0, 6.0}) {
        for (double ratio : {0.01, 0.03, 0.1, 0.33, 1.0, 3.0, 10.0}) {
          const Difference d = closed_form_error(beta, kappa, ratio, z);
          INFO("noise^2/v " << ratio << ", z " << z << ", beta " << beta << ", kappa " << kappa << ": log evidence "
                            << d.log_evidence << ", tau " << d.tau << ", ln E[lambda] " << d.log_lambda
                            << (d.by_quadrature ? " (quadrature used)" : " (closed form used)"));
          CHECK((d.by_quadrature || std::abs(d.log_evidence) < 0.03));
          CHECK((d.by_quadrature || std::abs(d.tau) < 0.03));
          if (d.by_quadrature) worst_outside = std::max(worst_outside, std::abs(d.log_evidence));
          if (ratio > 1.0 / 3) CHECK(d.by_quadrature);
        }
      }
    }
  }
  // The quadrature is not idle: there the closed form errs by nats.
  CHECK(worst_outside > 2);
}

TEST_CASE("several noisy readings of one region: the closed form, which is not used, errs more the more there are") {
  const std::vector<double> pattern{-0.6, 1.1, 0.2, -1.3, 0.7};
  double worst = 0;
  for (double rho : {0.0, 0.5}) {
    for (double z : {0.0, 1.0, 3.0, 6.0}) {
      for (double ratio : {0.01, 0.03, 0.1, 0.33, 1.0, 3.0, 10.0}) {
        const Nig prior{0, 50, 25, 25};
        const double noise = std::sqrt(ratio), common = z * std::sqrt(1 / prior.kappa + rho);
        std::vector<double> psi;
        for (double p : pattern) psi.push_back(common + p * std::sqrt(1 - rho + ratio));
        const std::vector<double> noise_sd(psi.size(), noise);
        const MaterialClass closed = tempered_material_class(prior, psi, noise_sd, rho);
        const MaterialClass exact = quadrature_material_class(prior, psi, noise_sd, rho);
        const MaterialClass used = noisy_material_class(prior, psi, noise_sd, rho);
        INFO("rho " << rho << ", noise^2/v " << ratio << ", mean at z " << z << ": log evidence "
                    << closed.log_evidence - exact.log_evidence << ", tau "
                    << closed.posterior.tau - exact.posterior.tau);
        CHECK(used.log_evidence == exact.log_evidence);
        worst = std::max(worst, std::abs(closed.log_evidence - exact.log_evidence));
      }
    }
  }
  CHECK(worst > 0.1);
  // 0.1 and -0.1 twenty times, noise 0.4: 120-digit arithmetic gives -35.946; the closed form -34.142.
  std::vector<double> psi;
  for (int i = 0; i < 20; ++i) psi.insert(psi.end(), {0.1, -0.1});
  CHECK(noisy_material_class({0, 50, 25, 25}, psi, std::vector<double>(40, 0.4), 0).log_evidence ==
        Approx(-35.946).margin(1e-3));
}

TEST_CASE(
    "readings with noise of few sizes have the posterior of readings whose noises all differ by next to nothing") {
  const Nig prior{0.4, 50, 25, 0.1};
  const std::vector<double> psi{0.31, 0.52, 0.44, 0.29, 0.61, 0.4}, noise{0.1, 0.02, 0.1, 0.1, 0.02, 0};
  std::vector<double> apart = noise;
  for (size_t i = 0; i < apart.size(); ++i) apart[i] += 1e-12 * double(i);
  for (const double rho : {0.0, 0.6}) {
    const MaterialClass few = quadrature_material_class(prior, psi, noise, rho),
                        many = quadrature_material_class(prior, psi, apart, rho);
    CHECK(few.log_evidence == Approx(many.log_evidence).margin(1e-8));
    CHECK(few.posterior.tau == Approx(many.posterior.tau).epsilon(1e-8));
    CHECK(few.posterior.kappa == Approx(many.posterior.kappa).epsilon(1e-8));
    CHECK(few.posterior.beta == Approx(many.posterior.beta).epsilon(1e-8));
    CHECK(few.posterior.gamma == Approx(many.posterior.gamma).epsilon(1e-8));
    CHECK(few.next_here.scale2 == Approx(many.next_here.scale2).epsilon(1e-8));
  }
}

TEST_CASE("a class that knows its precision adds noise as Gaussians do, however much it knows") {
  // Variance 0.04 of readings, 0.02 of the mean, 0.09 of the noise.
  for (const double beta : {2e6, 1e8, 1e15, 1e22, 1e40}) {
    INFO(beta);
    const NoisyReading after = noisy_update({0.1, 2, beta, 0.04 * beta}, 0.6, 0.3);
    const double variance = 0.02 + 0.04 + 0.09;
    CHECK(after.log_evidence == Approx(-0.5 * (0.25 / variance + std::log(2 * M_PI * variance))).margin(1e-5));
    CHECK(after.posterior.tau == Approx(0.1 + 0.5 * 0.02 / variance).epsilon(1e-5));
    CHECK(after.posterior.gamma / after.posterior.beta == Approx(0.04).epsilon(1e-5));
  }
}

TEST_CASE("the closed form of one reading is the tempered update, whatever the correlation") {
  const Nig p{0.4, 5, 3, 0.03};
  const double psi = 0.55, noise = 0.04, v = 0.01, s = v / (v + noise * noise), d = psi - p.tau;
  for (double rho : {0.0, 0.5, 0.9}) {
    const Nig q = tempered_material_class(p, {&psi, 1}, {&noise, 1}, rho).posterior;
    CHECK(q.kappa == Approx(5 + s));
    CHECK(q.tau == Approx((5 * 0.4 + s * psi) / (5 + s)));
    CHECK(q.beta == Approx(3 + s / 2));
    CHECK(q.gamma == Approx(0.03 + s * s * 5 * d * d / (2 * (5 + s))));
  }
}

}  // namespace felt
