#include "io/tables/property_yaml.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "core/error.h"

#include "tests/support/data.h"

using namespace felt;

namespace {

std::string message_of(const std::string& text) {
  try {
    parse_properties(text, "p.yaml");
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "";
}

}  // namespace

TEST_CASE("the shipped friction table holds the published eight materials") {
  const PropertyTable table = read_properties(felt::test::source_dir().string() + "/data/properties.yaml");
  REQUIRE(table.size() == 1);
  const Property& p = table[*table.index_of("friction")];
  CHECK(p.priors.size() == 8);
  CHECK(p.priors.at("ice").mean == 0.192);
  CHECK(p.priors.at("rock").sd == 0.133);
  CHECK(p.support_lo == 0);
  CHECK(std::isinf(p.support_hi));
  CHECK(p.rho == 0.5);
}

TEST_CASE("a support without an upper end is written as everybody writes it, or as YAML does") {
  for (const char* end : {"inf", ".inf", "+inf"}) {
    INFO(end);
    const PropertyTable table = parse_properties("friction: {unit: \"1\", support: [0, " + std::string(end) +
                                                     "], priors: {concrete: {mean: .543, sd: .065, readings: 1723}}}\n",
                                                 "p.yaml");
    CHECK(std::isinf(table[0].support_hi));
    CHECK(table[0].priors.at("concrete").mean == 0.543);
  }
  CHECK_THROWS_AS(parse_properties("friction: {support: [0, nan]}\n", "p.yaml"), ConfigError);
}

TEST_CASE("every problem of a property file is named at once with its line") {
  const std::string text =
      "friction:\n"
      "  support: [0]\n"
      "  rho: high\n"
      "  priors:\n"
      "    ice: {mean: .1}\n"
      "    snow: {mean: .1, sd: .2, count: 3}\n"
      "stiffness:\n"
      "  support: [1, 0]\n"
      "  priors: {ice: {mean: 0.5, sd: -1}}\n";
  const std::string message = message_of(text);
  for (const char* expected : {"p.yaml:2", "p.yaml:3", "p.yaml:5", "p.yaml:6", "p.yaml:7", "lo < hi",
                               "both mean and sd", "sd: expected a number from 1e-15 to 1e15, found -1"})
    CHECK_THAT(message, Catch::Contains(expected));
}

TEST_CASE("broken YAML, lists and repeated keys are configuration errors") {
  CHECK_THAT(message_of("a: [1"), Catch::Contains("p.yaml:") && Catch::Contains("not YAML"));
  CHECK_THAT(message_of("- a\n- b\n"), Catch::Contains("a mapping"));
  CHECK_THAT(message_of("f: {}\nf: {}\n"), Catch::Contains("p.yaml:2") && Catch::Contains("again"));
  CHECK_THAT(message_of("a/b: {}\n"), Catch::Contains("letters, digits"));
  CHECK_THROWS_AS(read_properties("/does/not/exist.yaml"), IoError);
}

TEST_CASE("a property table survives being written and read") {
  const PropertyTable table = parse_properties(
      "friction: {support: [0, .inf], priors: {\"true\": {mean: 0.1, sd: 0.30000000000000004, readings: 7}}}\n"
      "force: {unit: N, support: [-.inf, .inf], rho: 0.25, max_prior_readings: 9}\n",
      "p.yaml");
  CHECK(table.size() == 2);
  CHECK(parse_properties(properties_yaml(table), "again") == table);
}

TEST_CASE("class priors are calibrated from the readings behind them, up to the cap") {
  const ClassTable classes(
      {{0, "none", {}, true}, {1, "ice", {}, false}, {2, "sand", {}, false}, {3, "snow", {}, false}});
  const PropertyTable table = parse_properties(
      "friction: {priors: {ice: {mean: 0.2, sd: 0.1, readings: 1723}, snow: {mean: 0.4, sd: 0.2, readings: 10}}}", "p");
  const ClassPriors priors = class_priors(table[0], classes);
  REQUIRE(priors.size() == 3);
  CHECK(priors.kappa[0] == 50);
  CHECK(priors.beta[0] == 25);
  CHECK(priors.gamma[0] == Approx(0.25));
  CHECK(priors.has_prior[1] == 0);
  CHECK(priors.kappa[2] == 10);
  CHECK(priors.gamma[2] == Approx(0.2));
}
