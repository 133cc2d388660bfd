#include "inference/batch/material.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "inference/material.h"
#include "tests/support/inference_cases.h"
#include "tests/support/mixture_states.h"
#include "tests/support/simd_targets.h"

namespace felt::test {
namespace {

const std::vector<Nig> kPriors{{0.543, 50, 25, 25 * 0.065 * 0.065}, {0.192, 50, 25, 25 * 0.046 * 0.046}, Nig{}};

/// `n` voxels in three kinds of statistics, the first kind uncovered.
struct Region {
  explicit Region(size_t n_voxels)
      : n(n_voxels),
        count(n),
        mean(n),
        m2(n),
        concentration(n),
        surprise(n, -7.0f),
        belief(3, std::vector<float>(n)),
        out(15, std::vector<float>(n, -7.0f)) {
    for (size_t v = 0; v < n; ++v) {
      count[v] = float(v % 3);
      mean[v] = v % 3 == 1 ? 0.02f : 0.2f;
      m2[v] = v % 3 == 2 ? 0.003f : 0.0f;
      concentration[v] = 3 + float(v % 7);
      belief[0][v] = 0.2f;
      belief[1][v] = 0.5f;
      belief[2][v] = 0.3f;
    }
    for (size_t c = 0; c < 3; ++c) {
      float* a = out[5 * c].data();
      classes.push_back({kPriors[c], kPriors[c].tau, belief[c].data(), a});
      if (!has_prior(kPriors[c])) continue;
      classes[c].tau = out[5 * c + 1].data();
      classes[c].kappa = out[5 * c + 2].data();
      classes[c].beta = out[5 * c + 3].data();
      classes[c].gamma = out[5 * c + 4].data();
    }
  }

  MaterialBatch batch() {
    return {n, count.data(), mean.data(), m2.data(), 0.15, concentration.data(), classes, surprise.data()};
  }

  size_t n;
  std::vector<float> count, mean, m2, concentration, surprise;
  std::vector<std::vector<float>> belief, out;
  std::vector<MaterialPlanes> classes;
};

/// What a batch of random voxels, each its own state, is off from f64, in units of its stated bound. `wide`: counts,
/// spreads and evidence over many decades.
double worst_over_bound(unsigned seed, size_t k, double location, double scale, double rho, bool wide) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  constexpr size_t kVoxels = 150;
  std::vector<Nig> prior(k);
  for (Nig& p : prior) {
    const double sd = scale * log_uniform(rng, wide ? 1e-2 : 0.3, wide ? 10 : 1);
    p = {location + scale * normal(rng), wide ? log_uniform(rng, 1e-2, 1e4) : log_uniform(rng, 1, 60),
         wide ? log_uniform(rng, 1e-3, 1e4) : log_uniform(rng, 1, 60), 0};
    p.gamma = p.beta * sd * sd;
  }
  const size_t n = kVoxels;
  std::vector<float> count(n), mean(n), m2(n), concentration(n), surprise(n), belief(k * n), out(5 * k * n);
  std::vector<MaterialPlanes> classes(k);
  for (size_t c = 0; c < k; ++c) {
    float* at = &out[5 * c * n];
    classes[c] = {prior[c], prior[c].tau, &belief[c * n], at, at + n, at + 2 * n, at + 3 * n, at + 4 * n};
    for (size_t v = 0; v < n; ++v)
      belief[c * n + v] = float(wide ? log_uniform(rng, 1e-6, 1) : log_uniform(rng, 0.01, 1));
  }
  for (size_t v = 0; v < n; ++v) {
    count[v] = float(1 + rng() % (wide ? 100 : 8));
    mean[v] = float(scale * normal(rng) * (wide ? log_uniform(rng, 0.1, 1e4) : 1));
    m2[v] = count[v] > 1 ? float(count[v] * std::pow(scale * log_uniform(rng, 0.1, wide ? 1e3 : 0.5), 2)) : 0;
    concentration[v] = float(k) + float(rng() % 60);
  }
  const MaterialBatch batch{n,        count.data(),         mean.data(), m2.data(),
                            location, concentration.data(), classes,     surprise.data()};
  CHECK(material_view(batch, rho) == BatchCounts{n, 0, n});
  double worst = 0;
  for (size_t v = 0; v < n; ++v) {
    const ReadingStatistics readings{double(count[v]), double(mean[v]) + location, double(m2[v])};
    std::vector<double> pi(k);
    for (size_t c = 0; c < k; ++c) pi[c] = double(belief[c * n + v]);
    const MaterialPosterior expected = material_posterior(pi, prior, readings, rho);
    const double total = double(concentration[v]) + double(count[v]);
    const MomentMatchedView view = moment_matched_view(expected, prior, total);
    double evidence = 1;
    for (size_t c = 0; c < k; ++c)
      if (expected.belief.p[c] > 1e-6) evidence = std::max(evidence, std::abs(expected.classes[c].log_evidence));
    const double shift = std::abs(readings.n * std::log(scale));  // of the unit alone, which no class feels
    const double bound = 1e-5 + 2e-6 * (evidence + shift);
    const auto see = [&](double error) { worst = std::max(worst, std::isfinite(error) ? error / bound : 1e300); };
    see(std::abs(double(surprise[v]) - expected.belief.log_evidence) / std::max(1.0, evidence));
    for (size_t c = 0; c < k; ++c) {
      const MaterialPlanes& p = classes[c];
      const Nig& x = view.nig[c];
      see(std::abs(double(p.a[v]) - view.a[c]) / total);
      const double moved = std::abs(x.tau - prior[c].tau);  // may be thousands of spreads of the class
      see(std::abs(double(p.tau[v]) + p.tau_origin - x.tau) / std::max(moved, std::sqrt(plug_in_variance(x))));
      see(relative_error(double(p.kappa[v]), x.kappa));
      see(relative_error(double(p.beta[v]), x.beta));
      see(relative_error(double(p.gamma[v]), x.gamma));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE(
    "the f32 material kernel keeps its bound against f64 on every SIMD target, wherever the origin and whatever "
    "the unit") {
  on_every_simd_target([](const std::string& target) {
    for (size_t k : {1u, 2u, 8u, 21u}) {
      for (double rho : {0.0, 0.5, 0.95}) {
        INFO(target << ", k = " << k << ", rho = " << rho);
        CHECK(worst_over_bound(unsigned(k), k, 0.4, 0.1, rho, false) < 1);
        CHECK(worst_over_bound(unsigned(k), k, -300, 1e-3, rho, false) < 1);
        CHECK(worst_over_bound(unsigned(k), k, 0, 1e6, rho, false) < 1);
      }
    }
  });
}

TEST_CASE("extreme material states keep the bound too, never invalid and never NaN") {
  on_every_simd_target([](const std::string& target) {
    for (size_t k : {2u, 8u, 40u}) {
      INFO(target << ", k = " << k);
      CHECK(worst_over_bound(unsigned(k), k, 0.4, 0.1, 0.5, true) < 1);
    }
  });
}

TEST_CASE("priors and beliefs beyond what f32 vectors hold are computed in f64") {
  Region region(100);
  region.classes[0].prior.kappa = 1e20;
  for (size_t v = 0; v < region.n; ++v) region.belief[0][v] = region.belief[1][v] = 1e-36f;
  CHECK(material_view(region.batch(), 0.5).updated == 66);
  for (size_t v = 1; v < region.n; v += 3) {
    CHECK(std::isfinite(region.classes[1].kappa[v]));
    CHECK(double(region.classes[0].kappa[v]) > 0.9e20 * 0.5);
  }
}

TEST_CASE("the material view of a batch is the f64 posterior of each voxel, each distinct state computed once") {
  Region region(100);
  CHECK(material_view(region.batch(), 0.5) == BatchCounts{66, 0, 2});
  for (size_t v = 0; v < region.n; ++v) {
    if (v % 3 == 0) {
      REQUIRE(region.classes[0].a[v] == -7.0f);
      REQUIRE(region.surprise[v] == -7.0f);
      continue;
    }
    const ReadingStatistics readings{double(region.count[v]), double(region.mean[v]) + 0.15, double(region.m2[v])};
    const std::vector<double> belief{double(0.2f), 0.5, double(0.3f)};
    const MaterialPosterior expected = material_posterior(belief, kPriors, readings, 0.5);
    const MomentMatchedView view =
        moment_matched_view(expected, kPriors, double(region.concentration[v]) + double(region.count[v]));
    REQUIRE(double(region.surprise[v]) == Approx(expected.belief.log_evidence).epsilon(1e-6));
    for (size_t c = 0; c < 2; ++c) {
      const MaterialPlanes& p = region.classes[c];
      REQUIRE(relative_error(double(p.a[v]), view.a[c]) < 2e-5);
      REQUIRE(std::abs(double(p.tau[v]) + p.tau_origin - view.nig[c].tau) < 1e-6);
      REQUIRE(relative_error(double(p.kappa[v]), view.nig[c].kappa) < 2e-5);
      REQUIRE(relative_error(double(p.beta[v]), view.nig[c].beta) < 2e-5);
      REQUIRE(relative_error(double(p.gamma[v]), view.nig[c].gamma) < 2e-5);
    }
    REQUIRE(region.classes[2].a[v] > 0);  // a Dirichlet stays valid
    REQUIRE(region.classes[2].a[v] < 1e-30f);
  }
}

TEST_CASE("covered voxels whose statistics or belief are no numbers are left alone and counted") {
  Region region(100);
  region.mean[1] = std::numeric_limits<float>::quiet_NaN();
  region.m2[2] = -1;
  region.count[4] = std::numeric_limits<float>::infinity();
  region.belief[0][5] = -0.1f;
  region.belief[0][7] = region.belief[1][7] = 0;  // what is left has no prior
  region.concentration[8] = std::numeric_limits<float>::quiet_NaN();
  const BatchCounts counts = material_view(region.batch(), 0.5);
  CHECK(counts.refused == 6);
  CHECK(counts.updated == 60);
  for (size_t v : {1u, 2u, 4u, 5u, 7u, 8u}) CHECK(region.classes[1].tau[v] == -7.0f);
}

}  // namespace felt::test
