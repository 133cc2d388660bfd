// The Dirichlet projection where concentrations are many decades apart.
#include "inference/dirichlet.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "inference/batch/mixture.h"
#include "inference/mixture.h"
#include "tests/support/inference_cases.h"
#include "tests/support/mixture_states.h"
#include "tests/support/simd_targets.h"

namespace felt::test {
namespace {

using Numbers = std::vector<double>;

Numbers projected(const Numbers& a, const Numbers& r) {
  Numbers not_r(r.size()), out(r.size());
  for (size_t i = 0; i < r.size(); ++i) not_r[i] = 1 - r[i];
  project_dirichlet_kl(a, r, not_r, out);
  return out;
}

}  // namespace

TEST_CASE("a projected Dirichlet is exact where its concentrations are many decades apart") {
  struct Case {
    Numbers a, r, expected;
  };
  // `expected`: project_kl of the reference (dnig_reference.py), with 120 digits, for the E[ln w] of sum_j r_j Dir(a +
  // e_j).
  const Case cases[] = {
      {{50, 1e-9}, {0.25, 0.75}, {0.0005163938877110943, 3.999968944407137e-09}},
      {{1e-10, 1e-10}, {0.0078125, 0.9921875}, {9.257288625355059e-11, 1.043243445799075e-09}},
      {{1e5, 1e-10}, {0.9990234375, 0.0009765625}, {0.10199235202704643, 1.0009775149284484e-10}},
      {{1e8, 1e-8}, {0.5, 0.5}, {4.47939275141721, 1.9999993185222926e-08}},
      {{1e-10, 1e3, 1e-4},
       {0.875, 0.0625, 0.0625},
       {7.999999937330576e-10, 0.35956869418640164, 0.00010655537048193101}},
      {{1e10, 3e10}, {0.25, 0.75}, {1e10, 3e10}},
      {{1e-15, 1e-3}, {0.5, 0.5}, {1.9999980000020003e-15, 1.999998000002e-09}},
      {{1e15, 1e-15}, {0.5, 0.5}, {4.4793942116488425, 1.9999999999998676e-15}},
      {{1e14, 1e14, 2e14}, {0.5, 0.25, 0.25}, {100000000000000.23, 99999999999999.98, 199999999999999.72}},
  };
  for (const Case& c : cases) {
    const Numbers out = projected(c.a, c.r);
    for (size_t i = 0; i < c.a.size(); ++i) {
      INFO("a = " << c.a[0] << ", " << c.a[1] << ": class " << i);
      CHECK(relative_error(out[i], c.expected[i]) < 1e-12);
    }
  }
}

TEST_CASE("a Dirichlet that doubles cannot project is no number") {
  for (const Numbers& a : {Numbers{1e16, 1, 1}, Numbers{1, 1, 1e-16}, Numbers{4e14, 5e14, 1e-13}})
    for (const double x : projected(a, {0.0625, 0, 0.9375})) CHECK(std::isnan(x));
}

TEST_CASE("a batch keeps voxels right of which one class holds nearly all, on every SIMD target") {
  const Nig wood{0.4, 50, 25, 0.126}, ice{0.2, 50, 25, 0.053};
  on_every_simd_target([&](const std::string& target) {
    for (const Projection projection : {Projection::kl, Projection::published})
      for (const double others : {9e-5, 1e-7, 1e-9, 1e-12})
        for (const double largest : {1e-3, 1.0, 50.0, 1e6}) {
          MixtureStates states(2, 1);
          states.set(0, 0, largest, wood);
          states.set(0, 1, others, ice);
          const Numbers a = states.concentrations(0);
          const MixtureUpdate expected = mixture_update(a, states.nigs(0), 0.17, 0, projection);
          INFO(target << ", " << largest << " and " << others);
          REQUIRE(expected.valid);
          CHECK(update_mixture(states.batch(), 0.17, 0, projection).updated == 1);
          // `kl` is f64 rounded once, `published` keeps to f32: r is off by some 1e-5 of itself.
          const double tolerance = projection == Projection::kl ? 1e-6 : 2e-5;
          for (size_t c = 0; c < 2; ++c) {
            CHECK(relative_error(double(states.classes()[c].a[0]), expected.a[c]) < tolerance);
            CHECK(relative_error(states.nig(0, c).kappa, expected.nig[c].kappa) < tolerance);
          }
        }
  });
}

}  // namespace felt::test
