#include "inference/prior_fit.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

namespace felt {
namespace {

// Readings in groups with the given correlation within a group.
GroupedReadings draw(double mean, double sd, double rho, int groups, int size, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  GroupedReadings readings(static_cast<size_t>(groups));
  for (auto& group : readings) {
    const double offset = std::sqrt(rho) * normal(rng);
    for (int i = 0; i < size; ++i) group.push_back(mean + sd * (offset + std::sqrt(1 - rho) * normal(rng)));
  }
  return readings;
}

}  // namespace

TEST_CASE("a fit finds mean, spread and correlation of simulated readings") {
  for (double rho : {0.0, 0.5, 0.9}) {
    const auto fit = fit_prior(draw(0.4, 0.07, rho, 400, 6, 3));
    REQUIRE(fit);
    INFO("rho " << rho << ", found " << *fit->rho);
    CHECK(fit->mean == Approx(0.4).margin(0.012));
    CHECK(fit->sd == Approx(0.07).epsilon(0.06));
    CHECK(*fit->rho == Approx(rho).margin(0.06));
    CHECK(fit->effective_readings == Approx(2400 / (1 + 5 * *fit->rho)).epsilon(1e-9));
    CHECK(fit->nu_0 == 50);
  }
}

TEST_CASE("analysis of variance by hand") {
  // Two groups of two: means 1 and 4, within squares 2 + 2, between squares 2*(1.5^2)*2 = 9, size 2.
  const auto fit = fit_prior({{0, 2}, {3, 5}});
  REQUIRE(fit);
  const double within = 4.0 / 2, between = (9.0 / 1 - within) / 2;
  CHECK(fit->mean == 2.5);
  CHECK(*fit->rho == Approx(between / (between + within)));
  CHECK(fit->sd == Approx(std::sqrt(between + within)));
  CHECK(fit->effective_readings == Approx(4 / (1 + *fit->rho)));
}

TEST_CASE("analysis of variance of groups of unequal sizes by hand") {
  // Means 2 and 10 of 3 and 1 readings, 4 of all: within squares 8, between squares 3 * 2^2 + 6^2 = 48, size
  // (4 - 10 / 4) / 1 = 1.5.
  const auto fit = fit_prior({{0, 2, 4}, {10}});
  REQUIRE(fit);
  const double within = 8.0 / 2, between = (48 - within) / 1.5;
  CHECK(fit->mean == 4);
  CHECK(*fit->rho == Approx(between / (between + within)).epsilon(1e-12));
  CHECK(fit->sd == Approx(std::sqrt(between + within)).epsilon(1e-12));
  CHECK(fit->effective_readings == Approx(4 / (1 + 1.5 * *fit->rho)).epsilon(1e-12));
}

TEST_CASE("a property's correlation counts a class by its groups less one, and not where it has none") {
  PriorFit few, many, none;
  few.groups = 3, few.rho = 0.2;
  many.groups = 11, many.rho = 0.8;
  none.groups = 40;
  const PriorFit all[] = {few, none, many};
  CHECK(*pooled_rho(all) == Approx((2 * 0.2 + 10 * 0.8) / 12).epsilon(1e-12));
  CHECK_FALSE(pooled_rho({&none, 1}));
}

TEST_CASE("without groups there is no correlation to find, and one reading is no fit") {
  const auto fit = fit_prior({{0.1, 0.2, 0.4}});
  REQUIRE(fit);
  CHECK_FALSE(fit->rho);
  CHECK(fit->nu_0 == 3);
  // With the correlation of other classes three readings of one group are 3/(1 + 2 rho), and of its variance 1 - rho.
  const auto with_others = fit_prior({{0.1, 0.2, 0.4}}, 50, 0.5);
  REQUIRE(with_others);
  CHECK_FALSE(with_others->rho);
  CHECK(*with_others->assumed_rho == 0.5);
  CHECK(with_others->effective_readings == Approx(1.5));
  CHECK(with_others->sd == Approx(fit->sd * std::sqrt(2)));
  CHECK_FALSE(fit_prior({{0.1, 0.2}, {0.4, 0.3}}, 50, 0.5)->assumed_rho);
  CHECK_FALSE(fit_prior({{0.1}}));
  CHECK_FALSE(fit_prior({{0.1, 0.1}}));
  CHECK_FALSE(fit_prior({}));
}

TEST_CASE("goodness of fit tells a normal class from one of two clumps") {
  CHECK(fit_prior({draw(0.4, 0.07, 0, 1, 200, 5)[0]})->normal_is_plausible);
  std::vector<double> clumps(100, 0.0);
  for (size_t i = 0; i < clumps.size(); ++i) clumps[i] = (i % 2 == 0 ? 0.2 : 0.6) + 1e-3 * double(i % 7);
  CHECK_FALSE(fit_prior({clumps})->normal_is_plausible);
}

TEST_CASE("confusion after one touch is a half for equal classes and what normal tails give for strong priors") {
  const Nig a = calibrated_prior(0, 1, 1e6), b = calibrated_prior(2, 1, 1e6);
  CHECK(confusion_after_one_touch(a, a) == Approx(0.5).epsilon(1e-4));
  CHECK(confusion_after_one_touch(a, b) == Approx(0.5 * std::erfc(1 / std::sqrt(2.0))).epsilon(1e-3));
  CHECK(confusion_after_one_touch(calibrated_prior(0.192, 0.046), calibrated_prior(0.616, 0.048)) < 0.001);
  // Grass and concrete: a single friction reading hardly tells them apart.
  CHECK(confusion_after_one_touch(calibrated_prior(0.543, 0.065), calibrated_prior(0.577, 0.077)) > kInseparable);
}

}  // namespace felt
