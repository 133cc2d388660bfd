// The scalar inference library against references evaluated at 50 to 60 digits (see docs/inference.md).
#include <catch2/catch.hpp>
#include <cstdio>
#include <sstream>

#include "inference/material.h"
#include "inference/mixture.h"
#include "inference/noise.h"
#include "inference/special_functions.h"
#include "tests/support/inference_cases.h"

namespace felt::test {
namespace {

using nlohmann::json;
using Numbers = std::vector<double>;

struct Worst {
  double responsibility = 0, log_evidence = 0, tau = 0, parameter = 0, concentration = 0;
};

void see(double& worst, double error) { worst = std::max(worst, std::isnan(error) ? 1e300 : error); }

// Cases that no one has seen before: the reference program run with another seed. Empty where python3-mpmath is
// missing.
std::vector<json> fresh_cases(const std::filesystem::path& program, const std::string& arguments) {
  std::vector<json> cases;
  const std::string command = "python3 '" + program.string() + "' " + arguments + " 2> /dev/null";
  FILE* pipe = popen(command.c_str(), "r");
  std::string text;
  for (int c = pipe == nullptr ? EOF : std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) text += char(c);
  if (pipe == nullptr || pclose(pipe) != 0) return cases;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) cases.push_back(json::parse(line));
  return cases;
}

double evidence_error(double found, double expected) {
  return std::abs(found - expected) / std::max(1.0, std::abs(expected));
}

void compare_blocks(Worst& worst, const std::vector<Nig>& found, const std::vector<Nig>& expected, double spread) {
  for (size_t c = 0; c < expected.size(); ++c) {
    see(worst.tau, std::abs(found[c].tau - expected[c].tau) / spread);
    see(worst.parameter, relative_error(found[c].kappa, expected[c].kappa));
    see(worst.parameter, relative_error(found[c].beta, expected[c].beta));
    see(worst.parameter, relative_error(found[c].gamma, expected[c].gamma));
  }
}

void check_mixture_kl(const std::vector<json>& cases) {
  Worst worst;
  for (const json& line : cases) {
    const Numbers a = line["prior"]["a"];
    const std::vector<Nig> prior = nigs_of(line["prior"]);
    const MixtureUpdate found = mixture_update(a, prior, line["psi"]);
    CHECK(found.valid);
    for (size_t c = 0; c < a.size(); ++c) {
      see(worst.responsibility, std::abs(found.responsibility.p[c] - double(line["responsibility"][c])));
      see(worst.concentration, relative_error(found.a[c], line["kl"]["a"][c]));
    }
    see(worst.log_evidence, evidence_error(found.responsibility.log_evidence, line["log_evidence"]));
    compare_blocks(worst, found.nig, nigs_of(line["kl"]), class_spread(prior));
  }
  INFO("responsibility " << worst.responsibility << ", log evidence " << worst.log_evidence << ", tau " << worst.tau
                         << ", kappa/beta/gamma " << worst.parameter << ", a " << worst.concentration);
  CHECK(worst.responsibility < 1e-10);
  CHECK(worst.log_evidence < 1e-9);
  CHECK(worst.tau < 1e-7);
  CHECK(worst.parameter < 1e-7);
  CHECK(worst.concentration < 1e-7);
}

// How far rounding of psi - tau and of the parameters may move 1/kappa^: size of its terms over the size of their sum.
// The term that knows the origin, 2 r (1-r) shift E[mu] (E1-E0), may be large and of either sign.
double published_kappa_condition(const Nig& prior, double psi, double r, double not_r) {
  const Nig updated = conjugate_update(prior, psi);
  const double e0 = prior.beta / prior.gamma, e1 = updated.beta / updated.gamma, shift = updated.tau - prior.tau;
  const double positive = r / updated.kappa + not_r / prior.kappa + r * not_r * shift * shift * (not_r * e1 + r * e0);
  const double mean = prior.tau + r * shift;
  const double exact = positive + 2 * r * not_r * shift * mean * (e1 - e0);
  const double size = 2 * r * not_r * std::abs(shift) * (std::abs(prior.tau) + std::abs(psi)) * std::max(e1, e0);
  return (positive + size) / std::abs(exact);
}

int check_mixture_published(const std::vector<json>& cases) {
  Worst worst;
  double kappa_in_bound = 0;
  int wrong_flags = 0, invalid = 0;
  for (const json& line : cases) {
    const Numbers a = line["prior"]["a"];
    const std::vector<Nig> prior = nigs_of(line["prior"]);
    const double psi = line["psi"];
    const MixtureUpdate found = mixture_update(a, prior, psi, 0, Projection::published);
    const json& expected = line["published"];
    wrong_flags += found.valid != bool(expected["valid"]);
    invalid += !found.valid;
    for (size_t c = 0; c < a.size(); ++c) {
      see(worst.concentration, relative_error(found.a[c], expected["a"][c]));
      see(worst.tau, std::abs(found.nig[c].tau - double(expected["tau"][c])) / class_spread(prior));
      see(worst.parameter, relative_error(found.nig[c].beta, expected["beta"][c]));
      see(worst.parameter, relative_error(found.nig[c].gamma, expected["gamma"][c]));
      const double condition =
          published_kappa_condition(prior[c], psi, found.responsibility.p[c], found.responsibility.not_p[c]);
      see(kappa_in_bound, relative_error(found.nig[c].kappa, expected["kappa"][c]) / condition);
    }
  }
  INFO("wrong flags " << wrong_flags << ", invalid " << invalid << " of " << cases.size() << ", tau " << worst.tau
                      << ", beta/gamma " << worst.parameter << ", a " << worst.concentration
                      << ", kappa over condition " << kappa_in_bound);
  CHECK(wrong_flags == 0);
  CHECK(worst.tau < 1e-7);
  CHECK(worst.parameter < 1e-7);
  CHECK(worst.concentration < 1e-7);
  CHECK(kappa_in_bound < 1e-11);
  return invalid;
}

void check_material(const std::vector<json>& cases) {
  Worst worst;
  for (const json& line : cases) {
    const Numbers alpha = line["prior"]["alpha"], psi = line["psi"];
    const std::vector<Nig> prior = nigs_of(line["prior"]);
    const double spread = class_spread(prior);
    const MaterialPosterior found = material_posterior(alpha, prior, statistics_of(psi), line["rho"]);
    see(worst.log_evidence, evidence_error(found.belief.log_evidence, line["surprise"]));
    for (size_t c = 0; c < alpha.size(); ++c) {
      const json& expected = line["classes"][c];
      const MaterialClass& mine = found.classes[c];
      see(worst.responsibility, std::abs(found.belief.p[c] - double(line["class_probability"][c])));
      see(worst.log_evidence, evidence_error(mine.log_evidence, expected["log_evidence"]));
      see(worst.tau, std::abs(mine.posterior.tau - double(expected["tau"])) / spread);
      see(worst.tau, std::abs(mine.next_here.location - double(expected["next_location"])) / spread);
      see(worst.parameter, relative_error(mine.posterior.kappa, expected["kappa"]));
      see(worst.parameter, relative_error(mine.posterior.beta, expected["beta"]));
      see(worst.parameter, relative_error(mine.posterior.gamma, expected["gamma"]));
      see(worst.parameter, relative_error(mine.next_here.scale2, expected["next_scale2"]));
      see(worst.parameter, relative_error(mine.next_here.dof, expected["next_dof"]));
    }
  }
  INFO("class probability " << worst.responsibility << ", log evidence " << worst.log_evidence << ", tau " << worst.tau
                            << ", parameters " << worst.parameter);
  CHECK(worst.responsibility < 1e-10);
  CHECK(worst.log_evidence < 1e-9);
  CHECK(worst.tau < 1e-7);
  CHECK(worst.parameter < 1e-7);
}

void check_noise(const std::vector<json>& cases) {
  Worst worst;
  for (const json& line : cases) {
    const json& p = line["prior"];
    const Nig prior{p["tau"], p["kappa"], p["beta"], p["gamma"]};
    const double psi = line["psi"], sigma = line["sigma"];
    const MaterialClass found = quadrature_material_class(prior, {&psi, 1}, {&sigma, 1}, 0);
    see(worst.log_evidence, evidence_error(found.log_evidence, line["log_evidence"]));
    see(worst.tau, std::abs(found.posterior.tau - double(line["tau"])) / std::sqrt(plug_in_variance(prior)));
    see(worst.parameter, relative_error(1 / found.posterior.kappa, line["inv_kappa"]));
    see(worst.parameter, relative_error(found.posterior.beta / found.posterior.gamma, line["lam"]));
    const double log_lambda = digamma(found.posterior.beta) - std::log(found.posterior.gamma);
    see(worst.parameter, std::abs(log_lambda - double(line["log_lam"])));
  }
  INFO("log evidence " << worst.log_evidence << ", tau " << worst.tau << ", statistics " << worst.parameter);
  CHECK(worst.log_evidence < 1e-9);
  CHECK(worst.tau < 1e-9);
  CHECK(worst.parameter < 1e-9);
}

}  // namespace

TEST_CASE("one mixture update, projected by KL, agrees with the 60-digit reference") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  check_mixture_kl(read_json_lines(reference / "dnig_golden.jsonl", 160));
}

TEST_CASE("the published projection agrees with the reference within its conditioning and its validity flag is right") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  CHECK(check_mixture_published(read_json_lines(reference / "dnig_golden.jsonl", 160)) == 68);
}

TEST_CASE("material posterior agrees with the full-covariance reference") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  check_material(read_json_lines(reference / "material_golden.jsonl", 80));
}

TEST_CASE("a noisy reading by quadrature agrees with the reference") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  check_noise(read_json_lines(reference / "noise_golden.jsonl", 30));
}

TEST_CASE("freshly generated cases of other seeds agree as well as the stored ones") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  const auto dnig = fresh_cases(reference / "dnig_reference.py", "--cases 8 --seed 4711");
  const auto material = fresh_cases(reference / "touch_reference.py", "material --cases 8 --seed 4711");
  const auto noise = fresh_cases(reference / "touch_reference.py", "noise --cases 1 --seed 4711");
  if (dnig.empty() || material.empty() || noise.empty()) {
    skip("python3 with mpmath is not there");
    return;
  }
  REQUIRE(dnig.size() == 8);
  REQUIRE(material.size() == 8);
  REQUIRE(noise.size() == 1);
  check_mixture_kl(dnig);
  check_mixture_published(dnig);
  check_material(material);
  check_noise(noise);
}

}  // namespace felt::test
