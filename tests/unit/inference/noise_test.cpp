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
          needs_quadrature(prior, {&psi, 1}, {&noise, 1}, 0.5)};
}

}  // namespace

TEST_CASE("the closed form for noise is used only where it errs little; elsewhere quadrature is") {
  double worst_outside = 0;
  for (double beta : {2.5, 25.0, 250.0}) {
    for (double kappa : {1.0, 50.0}) {
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

TEST_CASE("several noisy readings of one region: where the closed form is used it errs little") {
  const std::vector<double> pattern{-0.6, 1.1, 0.2, -1.3, 0.7};
  double worst_outside = 0;
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
        const double error = closed.log_evidence - exact.log_evidence;
        const bool by_quadrature = needs_quadrature(prior, psi, noise_sd, rho);
        INFO("rho " << rho << ", noise^2/v " << ratio << ", mean at z " << z << ": log evidence " << error << ", tau "
                    << closed.posterior.tau - exact.posterior.tau << (by_quadrature ? " (quadrature used)" : ""));
        CHECK((by_quadrature || std::abs(error) < 0.03));
        CHECK((by_quadrature || std::abs(closed.posterior.tau - exact.posterior.tau) < 0.03));
        if (by_quadrature) worst_outside = std::max(worst_outside, std::abs(error));
      }
    }
  }
  CHECK(worst_outside > 0.1);
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
