// The f32 batch kernels against references evaluated at 60 digits; state rounded to f32, tau stored less the location
// of the case.
#include <catch2/catch.hpp>
#include <cmath>

#include "inference/batch/mixture.h"
#include "tests/support/inference_cases.h"
#include "tests/support/mixture_states.h"
#include "tests/support/simd_targets.h"

namespace felt::test {
namespace {

using nlohmann::json;

struct Worst {
  double ordinary = 0, extreme = 0;
};

void check_cases(const std::vector<json>& cases, const std::string& target) {
  Worst nig, concentration, responsibility;
  for (size_t i = 0; i < cases.size(); ++i) {
    const json& line = cases[i];
    const std::vector<Nig> prior = nigs_of(line["prior"]), expected = nigs_of(line["kl"]);
    const size_t k = prior.size();
    MixtureStates state(k, 1);
    for (size_t c = 0; c < k; ++c) {
      state.classes()[c].tau_origin = prior[0].tau;
      state.set(0, c, line["prior"]["a"][c], prior[c]);
    }
    CHECK(update_mixture(state.batch(), line["psi"]).updated == 1);
    const double spread = class_spread(prior);
    const bool extreme = i % 4 == 3;  // as the reference generates them
    const auto see = [&](Worst& worst, double error) {
      double& w = extreme ? worst.extreme : worst.ordinary;
      w = std::max(w, std::isfinite(error) ? error : 1e300);
    };
    for (size_t c = 0; c < k; ++c) {
      const Nig f = state.nig(0, c);
      see(nig, std::abs(f.tau - expected[c].tau) / spread);
      see(nig, relative_error(f.kappa, expected[c].kappa));
      see(nig, relative_error(f.beta, expected[c].beta));
      see(nig, relative_error(f.gamma, expected[c].gamma));
      see(concentration, relative_error(double(state.classes()[c].a[0]), line["kl"]["a"][c]));
      see(responsibility, std::abs(double(state.classes()[c].responsibility[0]) - double(line["responsibility"][c])));
    }
  }
  INFO(target << ": ordinary NIG " << nig.ordinary << ", a " << concentration.ordinary << ", r "
              << responsibility.ordinary << "; extreme NIG " << nig.extreme << ", a " << concentration.extreme << ", r "
              << responsibility.extreme);
  CHECK(std::max({nig.ordinary, concentration.ordinary, responsibility.ordinary}) < 5e-5);
  CHECK(std::max({nig.extreme, concentration.extreme, responsibility.extreme}) < 5e-5);
}

}  // namespace

TEST_CASE("the f32 mixture batch agrees with the 60-digit reference on every SIMD target") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  const std::vector<json> cases = read_json_lines(reference / "dnig_golden.jsonl", 160);
  on_every_simd_target([&](const std::string& target) { check_cases(cases, target); });
}

}  // namespace felt::test
