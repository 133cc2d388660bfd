// What must hold for every prior and reading, extremes included.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>
#include <random>

#include "inference/dirichlet.h"
#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/noise.h"
#include "inference/special_functions.h"

namespace felt {
namespace {

struct Case {
  std::vector<double> a;
  std::vector<Nig> prior;
  double psi = 0;
  double spread = 1;
};

// Concentrations 1e-3..1e6, shapes 1e-3..1e4, readings up to 1e6 spreads away.
Case random_case(std::mt19937& rng) {
  const auto log_uniform = [&](double low, double high) {
    return std::pow(10, std::uniform_real_distribution<double>(low, high)(rng));
  };
  std::normal_distribution<double> normal;
  Case c;
  const int k = std::array{1, 2, 3, 8, 20}[rng() % 5];
  c.spread = log_uniform(-3, 3);
  for (int i = 0; i < k; ++i) {
    const double beta = log_uniform(-3, 4), scale = c.spread * log_uniform(-1.5, 0.3);
    c.a.push_back(log_uniform(-3, 6));
    c.prior.push_back({c.spread * normal(rng), log_uniform(-1, 2), beta, beta * scale * scale});
  }
  c.psi = c.spread * normal(rng) * log_uniform(-1, 6);
  return c;
}

double log_mean(double r, double not_r, const Nig& updated, const Nig& prior) {
  return r * (digamma(updated.beta) - std::log(updated.gamma)) + not_r * (digamma(prior.beta) - std::log(prior.gamma));
}

}  // namespace

TEST_CASE("responsibilities sum to one, their complements agree, and the KL projection is always valid") {
  std::mt19937 rng(1);
  for (int i = 0; i < 3000; ++i) {
    const Case c = random_case(rng);
    const MixtureUpdate u = mixture_update(c.a, c.prior, c.psi);
    const std::vector<double>&r = u.responsibility.p, &not_r = u.responsibility.not_p;
    REQUIRE(std::accumulate(r.begin(), r.end(), 0.0) == Approx(1).epsilon(1e-13));
    REQUIRE(u.valid);
    for (size_t j = 0; j < r.size(); ++j) {
      REQUIRE(not_r[j] == Approx(1 - r[j]).margin(1e-14));
      REQUIRE(std::isfinite(u.nig[j].tau));
    }
  }
}

TEST_CASE("the KL projection keeps the expected natural statistics of every block and of the weights") {
  std::mt19937 rng(2);
  for (int i = 0; i < 1000; ++i) {
    const Case c = random_case(rng);
    const MixtureUpdate u = mixture_update(c.a, c.prior, c.psi);
    const double total = total_concentration(c.a), total_after = total_concentration(u.a);
    for (size_t j = 0; j < c.a.size(); ++j) {
      const double r = u.responsibility.p[j], not_r = u.responsibility.not_p[j];
      const Nig &p = c.prior[j], q = conjugate_update(p, c.psi), &out = u.nig[j];
      const double e0 = p.beta / p.gamma, e1 = q.beta / q.gamma, m = r * e1 + not_r * e0;
      REQUIRE(out.beta / out.gamma == Approx(m).epsilon(1e-12));
      REQUIRE(digamma(out.beta) - std::log(out.gamma) == Approx(log_mean(r, not_r, q, p)).epsilon(1e-10).margin(1e-10));
      REQUIRE((out.tau - p.tau) * m == Approx(r * e1 * (q.tau - p.tau)).epsilon(1e-9).margin(1e-12 * m * c.spread));
      const double d1 = q.tau - out.tau, d0 = p.tau - out.tau;
      REQUIRE(1 / out.kappa ==
              Approx(r * (1 / q.kappa + e1 * d1 * d1) + not_r * (1 / p.kappa + e0 * d0 * d0)).epsilon(1e-6));
      if (c.a.size() == 1) continue;
      const double expected = digamma(c.a[j]) + r / c.a[j] - digamma(total + 1);
      REQUIRE(digamma(u.a[j]) - digamma(total_after) == Approx(expected).epsilon(1e-11).margin(1e-11));
    }
  }
}

TEST_CASE("one class owns every reading: the update is the conjugate one") {
  std::mt19937 rng(3);
  for (int i = 0; i < 200; ++i) {
    Case c = random_case(rng);
    c.a.resize(1);
    c.prior.resize(1);
    for (Projection projection : {Projection::kl, Projection::published}) {
      const MixtureUpdate u = mixture_update(c.a, c.prior, c.psi, 0, projection);
      const Nig expected = conjugate_update(c.prior[0], c.psi);
      CHECK(u.responsibility.p[0] == 1);
      CHECK(u.a[0] == c.a[0] + 1);
      CHECK(u.nig[0].tau == Approx(expected.tau).epsilon(1e-14).margin(1e-14 * c.spread));
      CHECK(u.nig[0].kappa == Approx(expected.kappa).epsilon(1e-13));
      CHECK(u.nig[0].beta == Approx(expected.beta).epsilon(1e-13));
      CHECK(u.nig[0].gamma == Approx(expected.gamma).epsilon(1e-13));
    }
  }
}

TEST_CASE("moving the origin of the property by a representable step changes nothing but the locations") {
  std::mt19937 rng(4);
  for (int i = 0; i < 300; ++i) {
    Case c = random_case(rng);
    // Locations on a grid, so that the shift is exact and the answer may be asked for to the bit.
    c.spread = 1;
    for (Nig& p : c.prior) p.tau = std::round(std::ldexp(p.tau, 10)) / 1024;
    c.psi = std::round(std::ldexp(std::clamp(c.psi, -1e3, 1e3), 10)) / 1024;
    Case moved = c;
    for (Nig& p : moved.prior) p.tau += 1048576;
    moved.psi += 1048576;
    const MixtureUpdate u = mixture_update(c.a, c.prior, c.psi), v = mixture_update(moved.a, moved.prior, moved.psi);
    REQUIRE(u.responsibility.p == v.responsibility.p);
    REQUIRE(u.a == v.a);
    const std::vector<double> psi{c.psi, c.psi + 0.25, c.psi - 2}, far{moved.psi, moved.psi + 0.25, moved.psi - 2};
    const std::vector<double> noise(3, 0.5);
    const auto m = material_posterior(c.a, c.prior, psi, noise, 0.3),
               n = material_posterior(moved.a, moved.prior, far, noise, 0.3);
    for (size_t j = 0; j < c.a.size(); ++j) {
      REQUIRE(v.nig[j].tau - 1048576 == Approx(u.nig[j].tau).margin(1e-9));
      REQUIRE(v.nig[j].kappa == Approx(u.nig[j].kappa).epsilon(1e-6));
      REQUIRE(v.nig[j].beta == u.nig[j].beta);
      REQUIRE(v.nig[j].gamma == u.nig[j].gamma);
      REQUIRE(n.belief.p[j] == Approx(m.belief.p[j]).margin(1e-9));
    }
  }
}

TEST_CASE("another unit of the property scales the answer") {
  std::mt19937 rng(5);
  for (int i = 0; i < 300; ++i) {
    const Case c = random_case(rng);
    Case scaled = c;
    for (Nig& p : scaled.prior) p = {1000 * p.tau, p.kappa, p.beta, 1e6 * p.gamma};
    const std::vector<double> psi{c.psi, 0.9 * c.psi}, larger{1000 * c.psi, 900 * c.psi};
    const MixtureUpdate u = mixture_update(c.a, c.prior, psi[0]), v = mixture_update(scaled.a, scaled.prior, larger[0]);
    const auto m = material_posterior(c.a, c.prior, statistics_of(psi), 0.5);
    const auto n = material_posterior(scaled.a, scaled.prior, statistics_of(larger), 0.5);
    REQUIRE(v.responsibility.log_evidence ==
            Approx(u.responsibility.log_evidence - std::log(1000)).epsilon(1e-10).margin(1e-10));
    for (size_t j = 0; j < c.a.size(); ++j) {
      REQUIRE(v.responsibility.p[j] == Approx(u.responsibility.p[j]).margin(1e-10));
      REQUIRE(v.nig[j].kappa == Approx(u.nig[j].kappa).epsilon(1e-9));
      REQUIRE(v.nig[j].gamma == Approx(1e6 * u.nig[j].gamma).epsilon(1e-9));
      REQUIRE(n.belief.p[j] == Approx(m.belief.p[j]).margin(1e-9));
    }
  }
}

TEST_CASE("the names of the classes do not matter: a permutation of them permutes the answer") {
  std::mt19937 rng(6);
  for (int i = 0; i < 300; ++i) {
    const Case c = random_case(rng);
    std::vector<size_t> order(c.a.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), rng);
    Case other = c;
    for (size_t j = 0; j < order.size(); ++j) {
      other.a[j] = c.a[order[j]];
      other.prior[j] = c.prior[order[j]];
    }
    const MixtureUpdate u = mixture_update(c.a, c.prior, c.psi), v = mixture_update(other.a, other.prior, other.psi);
    for (size_t j = 0; j < order.size(); ++j) {
      REQUIRE(v.responsibility.p[j] == Approx(u.responsibility.p[order[j]]).margin(1e-13));
      REQUIRE(v.a[j] == Approx(u.a[order[j]]).epsilon(1e-8));
      REQUIRE(v.nig[j].beta == Approx(u.nig[order[j]].beta).epsilon(1e-10));
    }
  }
}

TEST_CASE("the order of readings does not matter to a material, nor how they are grouped into statistics") {
  std::mt19937 rng(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 300; ++i) {
    const Case c = random_case(rng);
    std::vector<double> psi(size_t(1 + rng() % 8)), noise(psi.size());
    for (size_t j = 0; j < psi.size(); ++j) {
      psi[j] = c.spread * normal(rng);
      noise[j] = c.spread * std::abs(normal(rng));
    }
    std::vector<size_t> order(psi.size());
    std::iota(order.begin(), order.end(), 0);
    std::shuffle(order.begin(), order.end(), rng);
    std::vector<double> shuffled, shuffled_noise;
    for (size_t j : order) {
      shuffled.push_back(psi[j]);
      shuffled_noise.push_back(noise[j]);
    }
    for (bool noisy : {false, true}) {
      const std::vector<double> none;
      const auto u = material_posterior(c.a, c.prior, psi, noisy ? noise : none, 0.6);
      const auto v = material_posterior(c.a, c.prior, shuffled, noisy ? shuffled_noise : none, 0.6);
      for (size_t j = 0; j < c.a.size(); ++j) {
        REQUIRE(v.belief.p[j] == Approx(u.belief.p[j]).margin(1e-10));
        REQUIRE(v.classes[j].posterior.gamma == Approx(u.classes[j].posterior.gamma).epsilon(1e-9));
        REQUIRE(v.classes[j].posterior.tau == Approx(u.classes[j].posterior.tau).margin(1e-9 * c.spread));
      }
    }
  }
}

TEST_CASE(
    "a material's posterior stays valid and its view a proper state, far readings and strong correlation included") {
  std::mt19937 rng(8);
  for (int i = 0; i < 1000; ++i) {
    const Case c = random_case(rng);
    std::vector<double> psi(size_t(rng() % 9), c.psi);
    for (size_t j = 0; j < psi.size(); ++j) psi[j] *= 1 + 1e-3 * double(j);
    const double rho = std::array{0.0, 0.3, 0.95, 0.999999}[rng() % 4];
    const MaterialPosterior m = material_posterior(c.a, c.prior, statistics_of(psi), rho);
    const double total = total_concentration(c.a) + double(psi.size());
    const MomentMatchedView view = moment_matched_view(m, c.prior, total);
    REQUIRE(std::accumulate(m.belief.p.begin(), m.belief.p.end(), 0.0) == Approx(1));
    REQUIRE(total_concentration(view.a) == Approx(total));
    for (size_t j = 0; j < c.a.size(); ++j) {
      REQUIRE(is_valid(m.classes[j].posterior));
      REQUIRE(is_valid(view.nig[j]));
      REQUIRE(view.a[j] > 0);
      REQUIRE(m.classes[j].next_here.scale2 > 0);
    }
  }
}

TEST_CASE("without readings a material is what vision says") {
  const std::vector<double> belief{1, 3};
  const std::vector<Nig> prior{{0.4, 50, 25, 0.1}, {0.2, 50, 25, 0.05}};
  const MaterialPosterior m = material_posterior(belief, prior, ReadingStatistics{}, 0.5);
  CHECK(m.belief.p == std::vector<double>{0.25, 0.75});
  CHECK(m.belief.log_evidence == Approx(0).margin(1e-15));
  CHECK(m.classes[0].posterior == prior[0]);
  CHECK(m.classes[1].next_here.scale2 == Approx(predictive(prior[1]).scale2));
}

TEST_CASE("one reading means the same to a material of any correlation as to a mixture") {
  std::mt19937 rng(9);
  for (int i = 0; i < 200; ++i) {
    const Case c = random_case(rng);
    const ClassPosterior r = responsibilities(c.a, c.prior, c.psi);
    for (double rho : {0.0, 0.7}) {
      const MaterialPosterior m = material_posterior(c.a, c.prior, statistics_of(std::vector<double>{c.psi}), rho);
      REQUIRE(m.belief.log_evidence == Approx(r.log_evidence).epsilon(1e-10));
      for (size_t j = 0; j < c.a.size(); ++j) {
        REQUIRE(m.belief.p[j] == Approx(r.p[j]).margin(1e-10));
        REQUIRE(m.classes[j].posterior.gamma == Approx(conjugate_update(c.prior[j], c.psi).gamma).epsilon(1e-13));
      }
    }
  }
}

TEST_CASE("a class without a prior takes no part: its probability is 0 and the others share the mass") {
  const std::vector<double> a{2, 5, 1};
  const std::vector<Nig> prior{{0.4, 50, 25, 0.1}, Nig{}, {0.2, 50, 25, 0.05}};
  const MixtureUpdate u = mixture_update(a, prior, 0.3);
  const ClassPosterior pair = responsibilities(std::vector<double>{2, 1}, std::vector<Nig>{prior[0], prior[2]}, 0.3);
  CHECK(u.responsibility.p == std::vector<double>{pair.p[0], 0, pair.p[1]});
  CHECK(u.responsibility.log_evidence == pair.log_evidence);
  CHECK(u.valid);
  CHECK_FALSE(has_prior(u.nig[1]));
  const MaterialPosterior m = material_posterior(a, prior, statistics_of(std::vector<double>{0.3}), 0.5);
  CHECK(m.belief.p[1] == 0);
  CHECK(moment_matched_view(m, prior, 9).a[1] > 0);
  CHECK_THROWS(mixture_update(a, std::vector<Nig>(3), 0.3));
}

TEST_CASE("noise that vanishes leaves the exact update, and noise without bound leaves the prior") {
  std::mt19937 rng(10);
  for (int i = 0; i < 100; ++i) {
    Case c = random_case(rng);
    c.psi = c.spread * std::clamp(c.psi / c.spread, -5.0, 5.0);
    // Below one degree of freedom the class's own spread has no bound, and no noise is large against it.
    Nig p = c.prior[0];
    p.gamma *= std::max(1.0, p.beta) / p.beta;
    p.beta = std::max(1.0, p.beta);
    const double sd = std::sqrt(plug_in_variance(p));
    const NoisyReading exact = noisy_update(p, c.psi, 0), nearly = noisy_update(p, c.psi, 1e-6 * sd);
    REQUIRE(nearly.log_evidence == Approx(exact.log_evidence).epsilon(1e-6).margin(1e-6));
    REQUIRE(nearly.posterior.gamma == Approx(exact.posterior.gamma).epsilon(1e-6));
    const NoisyReading nothing = noisy_update(p, c.psi, 1e6 * (sd + std::abs(c.psi - p.tau)));
    REQUIRE(is_valid(nothing.posterior));
    REQUIRE(nothing.posterior.tau == Approx(p.tau).margin(1e-5 * c.spread));
    REQUIRE(nothing.posterior.kappa == Approx(p.kappa).epsilon(1e-3));
    REQUIRE(nothing.posterior.beta / nothing.posterior.gamma == Approx(p.beta / p.gamma).epsilon(1e-2));
  }
}

}  // namespace felt
