#include "inference/batch_material.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "inference/material.h"
#include "tests/support/inference_cases.h"

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

}  // namespace

TEST_CASE("the material view of a batch is the f64 posterior of each voxel, each distinct state computed once") {
  Region region(100);
  CHECK(material_view(region.batch(), 0.5) == MaterialCounts{66, 0, 2});
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
      REQUIRE(relative_error(double(p.a[v]), view.a[c]) < 1e-6);
      REQUIRE(std::abs(double(p.tau[v]) + p.tau_origin - view.nig[c].tau) < 1e-8);
      REQUIRE(relative_error(double(p.kappa[v]), view.nig[c].kappa) < 1e-6);
      REQUIRE(relative_error(double(p.beta[v]), view.nig[c].beta) < 1e-6);
      REQUIRE(relative_error(double(p.gamma[v]), view.nig[c].gamma) < 1e-6);
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
  const MaterialCounts counts = material_view(region.batch(), 0.5);
  CHECK(counts.refused == 6);
  CHECK(counts.updated == 60);
  for (size_t v : {1u, 2u, 4u, 5u, 7u, 8u}) CHECK(region.classes[1].tau[v] == -7.0f);
}

}  // namespace felt::test
