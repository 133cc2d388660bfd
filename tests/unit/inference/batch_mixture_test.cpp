#include "inference/batch/mixture.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "inference/mixture.h"
#include "inference/special_functions.h"
#include "tests/support/inference_cases.h"
#include "tests/support/mixture_states.h"
#include "tests/support/simd_targets.h"

namespace felt::test {
namespace {

struct Errors {
  double responsibility = 0, log_evidence = 0, a = 0, tau = 0, kappa = 0, beta = 0, gamma = 0;
  double largest() const { return std::max({responsibility, a, tau, kappa, beta, gamma}); }
};

void see(double& worst, double error) { worst = std::max(worst, std::isfinite(error) ? error : 1e300); }

std::ostream& operator<<(std::ostream& out, const Errors& e) {
  return out << "r " << e.responsibility << " evidence " << e.log_evidence << " a " << e.a << " tau " << e.tau
             << " kappa " << e.kappa << " beta " << e.beta << " gamma " << e.gamma;
}

/// One voxel of `found` against f64 `expected`; tau relative to sqrt(gamma/beta) of the class.
void compare(Errors& e, const MixtureStates& found, size_t v, const MixtureUpdate& expected) {
  for (size_t c = 0; c < found.k(); ++c) {
    see(e.a, relative_error(double(found.classes()[c].a[v]), expected.a[c]));
    see(e.responsibility, std::abs(double(found.classes()[c].responsibility[v]) - expected.responsibility.p[c]));
    if (found.classes()[c].tau == nullptr) continue;
    const Nig f = found.nig(v, c), x = expected.nig[c];
    see(e.tau, std::abs(f.tau - x.tau) / std::sqrt(plug_in_variance(x)));
    see(e.kappa, relative_error(f.kappa, x.kappa));
    see(e.beta, relative_error(f.beta, x.beta));
    see(e.gamma, relative_error(f.gamma, x.gamma));
  }
  const double evidence = expected.responsibility.log_evidence;
  see(e.log_evidence, std::abs(double(found.log_evidence(v)) - evidence) / std::max(1.0, std::abs(evidence)));
}

/// Against f64 on the same f32 state.
Errors errors_of_update(MixtureStates states, double psi, double noise_sd = 0) {
  const MixtureStates before = states;
  const BatchCounts counts = update_mixture(states.batch(), psi, noise_sd);
  CHECK(counts.updated == states.n());
  CHECK(counts.refused == 0);
  Errors e;
  for (size_t v = 0; v < states.n(); ++v)
    compare(e, states, v, mixture_update(before.concentrations(v), before.nigs(v), psi, noise_sd));
  return e;
}

/// How far a^ may be off, relative, where r is off by `of_r` min(r, 1 - r) and each term of the projection's equation
/// by two roundings to f32: the first-order change of the solution (inverse Hessian times change of the equation).
/// Large where nearly all classes are rare: then little determines the sum of a^.
std::vector<double> concentration_bound(const std::vector<double>& a, const MixtureUpdate& exact, double of_r) {
  const size_t k = a.size();
  std::vector<double> change(k), slope(k);
  double total = 0, sum = 0, stiffness = 0;
  for (size_t c = 0; c < k; ++c) {
    const double x = exact.a[c], r = exact.responsibility.p[c], least = std::min(r, exact.responsibility.not_p[c]);
    const double moved = std::abs(digamma_difference(a[c], x - a[c]));
    change[c] = of_r * least / a[c] + 4 * 0x1p-24 * (r / a[c] + moved);
    slope[c] = 1 / (x * trigamma(x));
    sum += x * slope[c] * change[c];
    stiffness -= x * slope[c];
    total += x;
  }
  stiffness += 1 / trigamma(total);
  std::vector<double> bound(k);
  for (size_t c = 0; c < k; ++c) bound[c] = 2e-5 + slope[c] * (change[c] + sum / stiffness);
  return bound;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](float x, float y) { return std::bit_cast<uint32_t>(x) == std::bit_cast<uint32_t>(y); });
}

}  // namespace

TEST_CASE("a batch of ordinary voxels agrees with the f64 update on every SIMD target") {
  on_every_simd_target([](const std::string& target) {
    for (size_t k : {1u, 2u, 3u, 8u, 21u}) {
      for (double psi : {0.35, 0.55, 0.8}) {
        const Errors e = errors_of_update(ordinary_states(k, 259, unsigned(k)), psi);
        INFO(target << ", k = " << k << ", psi = " << psi << ": " << e);
        CHECK(e.largest() < 2e-5);
        CHECK(e.log_evidence < 2e-6);
      }
    }
  });
}

TEST_CASE("extreme voxels keep the stated bound, never invalid and never NaN, on every SIMD target") {
  on_every_simd_target([](const std::string& target) {
    for (size_t k : {2u, 8u, 40u}) {
      for (double psi : {0.1, 3.0, -30.0, 1e4}) {
        MixtureStates states = extreme_states(k, 200, unsigned(k));
        const MixtureStates before = states;
        CHECK(update_mixture(states.batch(), psi).updated == states.n());
        double worst = 0, worst_a = 0, largest_a = 0;
        for (size_t v = 0; v < states.n(); ++v) {
          const MixtureUpdate expected = mixture_update(before.concentrations(v), before.nigs(v), psi);
          double largest = 1;
          for (size_t c = 0; c < k; ++c)
            if (expected.responsibility.p[c] > 1e-6)
              largest = std::max(largest, std::abs(log_evidence(before.nig(v, c), psi)));
          Errors e;
          compare(e, states, v, expected);
          const std::vector<double> a_bound =
              concentration_bound(before.concentrations(v), expected, 1e-5 + 1e-6 * largest);
          for (size_t c = 0; c < k; ++c)
            see(worst_a, relative_error(double(states.classes()[c].a[v]), expected.a[c]) / a_bound[c]);
          largest_a = std::max(largest_a, e.a);
          e.a = 0;
          worst = std::max(worst, e.largest() / (1e-5 + 1e-6 * largest));
        }
        INFO(target << ", k = " << k << ", psi = " << psi);
        INFO("a: " << worst_a << " of the bound, " << largest_a << " relative");
        CHECK(worst < 1);
        CHECK(worst_a < 1);
        CHECK(largest_a < 1e-2);
      }
    }
  });
}

TEST_CASE("avx2 and avx3 give the same bits") {
  std::vector<MixtureStates> results;
  for (const std::string& target : simd_names()) {
    if (target != "avx2" && target != "avx3") continue;
    choose_simd(target, "test");
    results.push_back(extreme_states(8, 333, 2));
    update_mixture(results.back().batch(), 0.3);
  }
  choose_simd("", "test");
  if (results.size() < 2) return;
  CHECK(same_bits(results[0].values(), results[1].values()));
}

TEST_CASE("shift and scale of the property do not hurt the f32 batch") {
  on_every_simd_target([](const std::string& target) {
    INFO(target);
    for (double location : {0.0, -300.0, 1e6}) {
      CHECK(errors_of_update(ordinary_states(8, 100, 3, location, 0.1), location + 0.1).largest() < 2e-5);
    }
    for (double scale : {1e-8, 1e8}) {
      CHECK(errors_of_update(ordinary_states(8, 100, 3, 4 * scale, scale), 5 * scale).largest() < 2e-5);
    }
    CHECK(errors_of_update(ordinary_states(8, 100, 4), 1e6).largest() < 1e-3);
    CHECK(errors_of_update(ordinary_states(8, 100, 4), -1e6).largest() < 1e-3);
  });
}

TEST_CASE("a noisy reading takes the tempered closed form, and quadrature where the noise is large") {
  on_every_simd_target([](const std::string& target) {
    INFO(target);
    CHECK(errors_of_update(ordinary_states(8, 60, 5), 0.5, 0.005).largest() < 2e-5);
    CHECK(errors_of_update(ordinary_states(4, 20, 5), 0.5, 0.08).largest() < 2e-5);
  });
}

TEST_CASE("a class without a prior has responsibility zero and shares the Dirichlet projection") {
  on_every_simd_target([](const std::string& target) {
    INFO(target);
    MixtureStates states = ordinary_states(5, 70, 6);
    states.forget_prior(2);
    CHECK(errors_of_update(states, 0.5).largest() < 2e-5);
    update_mixture(states.batch(), 0.5);
    for (size_t v = 0; v < states.n(); ++v) REQUIRE(states.classes()[2].responsibility[v] == 0.0f);
    MixtureStates no_class = ordinary_states(2, 33, 6);
    no_class.forget_prior(0);
    no_class.forget_prior(1);
    const std::vector<float> before = no_class.values();
    CHECK(update_mixture(no_class.batch(), 0.5) == BatchCounts{0, 33, 0});
    CHECK(same_bits(before, no_class.values()));
  });
}

TEST_CASE("a voxel whose state is no prior is refused, keeps its bits, and does not disturb its neighbours") {
  on_every_simd_target([](const std::string& target) {
    INFO(target);
    const MixtureStates sound = ordinary_states(3, 64, 8);
    MixtureStates states = sound, expected = sound;
    const float bad[] = {0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()};
    for (size_t i = 0; i < 4; ++i) {
      states.classes()[0].a[3 + i] = bad[i];
      states.classes()[1].kappa[13 + i] = bad[i];
      states.classes()[2].beta[23 + i] = bad[i];
      states.classes()[0].gamma[33 + i] = bad[i];
    }
    states.classes()[1].tau[43] = bad[2];
    states.classes()[1].tau[44] = bad[3];
    const MixtureStates before = states;
    CHECK(update_mixture(states.batch(), 0.5).refused == 18);
    update_mixture(expected.batch(), 0.5);
    for (size_t v = 0; v < states.n(); ++v) {
      const MixtureStates& like = states.updated()[v] != 0 ? expected : before;
      for (size_t c = 0; c < 3; ++c) {
        REQUIRE(std::bit_cast<uint32_t>(states.classes()[c].a[v]) == std::bit_cast<uint32_t>(like.classes()[c].a[v]));
        REQUIRE(std::bit_cast<uint32_t>(states.classes()[c].tau[v]) ==
                std::bit_cast<uint32_t>(like.classes()[c].tau[v]));
        REQUIRE(std::bit_cast<uint32_t>(states.classes()[c].gamma[v]) ==
                std::bit_cast<uint32_t>(like.classes()[c].gamma[v]));
      }
    }
    CHECK(update_mixture(states.batch(), std::numeric_limits<double>::quiet_NaN()).updated == 0);
  });
}

TEST_CASE("published refuses the same voxels as f64, which keep their state, and updates the others alike") {
  on_every_simd_target([](const std::string& target) {
    INFO(target);
    const double psi = 1.5;
    MixtureStates states = ordinary_states(4, 500, 9, 0.4, 0.3);
    const MixtureStates before = states;
    const BatchCounts counts = update_mixture(states.batch(), psi, 0, Projection::published);
    size_t refused = 0, close_calls = 0;
    Errors e;
    for (size_t v = 0; v < states.n(); ++v) {
      const MixtureUpdate expected =
          mixture_update(before.concentrations(v), before.nigs(v), psi, 0, Projection::published);
      refused += !expected.valid;
      if (!expected.valid) {
        REQUIRE(states.updated()[v] == 0);
        for (size_t c = 0; c < 4; ++c) REQUIRE(states.nig(v, c) == before.nig(v, c));
        continue;
      }
      REQUIRE(states.updated()[v] == 1);
      const bool close =
          std::any_of(expected.nig.begin(), expected.nig.end(), [](const Nig& p) { return p.kappa > 1e4; });
      close_calls += close;
      if (!close) compare(e, states, v, expected);
    }
    INFO(e);
    CHECK(counts.refused == refused);
    CHECK(refused > 50);
    CHECK(refused < 450);
    CHECK(close_calls < 10);
    CHECK(e.largest() < 1e-3);
  });
}

TEST_CASE("equal voxels are computed once and a voxel's result does not depend on its batch") {
  on_every_simd_target([](const std::string& target) {
    INFO(target);
    // 1037 voxels that take one of five states, 40 of them left out.
    const MixtureStates five = ordinary_states(3, 5, 10);
    MixtureStates many(3, 1037);
    for (size_t v = 0; v < many.n(); ++v) {
      for (size_t c = 0; c < 3; ++c) {
        many.classes()[c].tau_origin = five.classes()[c].tau_origin;
        many.set(v, c, double(five.classes()[c].a[v % 5]), five.nig(v % 5, c));
      }
      many.selected()[v] = v % 26 != 7;
    }
    const MixtureStates before = many;
    const BatchCounts counts = update_mixture(many.batch(), 0.5);
    CHECK(counts.computed == 5);
    CHECK(counts.updated == 1037 - 40);
    MixtureStates alone = five;
    update_mixture(alone.batch(), 0.5);
    for (size_t v = 0; v < many.n(); ++v) {
      const MixtureStates& like = many.selected()[v] ? alone : before;
      const size_t w = many.selected()[v] ? v % 5 : v;
      REQUIRE(many.updated()[v] == many.selected()[v]);
      for (size_t c = 0; c < 3; ++c) {
        REQUIRE(many.classes()[c].a[v] == like.classes()[c].a[w]);
        REQUIRE(many.nig(v, c) == like.nig(w, c));
      }
    }
  });
}

TEST_CASE("a batch gives the same bits on one thread and on many, and with voxels in another order") {
  const MixtureStates start = ordinary_states(4, 5000, 11);
  MixtureStates one = start, many = start, reversed = start;
  {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
    update_mixture(one.batch(), 0.5);
  }
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 4);
  update_mixture(many.batch(), 0.5);
  CHECK(same_bits(one.values(), many.values()));
  const size_t n = start.n();
  const auto reverse = [&] {
    for (MixturePlanes& p : reversed.classes())
      for (float* plane : {p.a, p.tau, p.kappa, p.beta, p.gamma}) std::reverse(plane, plane + n);
  };
  reverse();
  update_mixture(reversed.batch(), 0.5);
  reverse();
  for (size_t c = 0; c < 4; ++c) {
    REQUIRE(std::equal(one.classes()[c].a, one.classes()[c].a + n, reversed.classes()[c].a));
    REQUIRE(std::equal(one.classes()[c].beta, one.classes()[c].beta + n, reversed.classes()[c].beta));
  }
}

TEST_CASE("a class that the reading says nothing about keeps its bits") {
  MixtureStates states = ordinary_states(2, 40, 12, 0.4, 0.01);
  for (size_t v = 0; v < states.n(); ++v) states.set(v, 1, 3, {1e4, 50, 200, 1e-2});
  const MixtureStates before = states;
  update_mixture(states.batch(), 0.4);
  for (size_t v = 0; v < states.n(); ++v) REQUIRE(states.nig(v, 1) == before.nig(v, 1));
}

}  // namespace felt::test
