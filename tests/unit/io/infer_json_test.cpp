#include "io/readings/infer_json.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "inference/mixture.h"

namespace felt {
namespace {

using nlohmann::json;

json ask(const std::string& line) { return json::parse(infer_json_line(line, 7).json); }

const char* const kGood =
    R"({"prior": {"a": [1, 3], "tau": [0.4, 0.2], "kappa": [50, 5], "beta": [25, 2], "gamma": [0.1, 0.02]}, "psi": 0.3})";

json good_with(const std::string& pointer, const json& value) {
  json line = json::parse(kGood);
  line[json::json_pointer(pointer)] = value;
  return line;
}

}  // namespace

TEST_CASE("a line without a model is a mixture for a number and a material for a list") {
  CHECK(ask(kGood).contains("responsibility"));
  json line = json::parse(kGood);
  line["psi"] = {0.3, 0.31};
  const json answer = ask(line.dump());
  CHECK(answer.contains("class_probability"));
  CHECK(answer["classes"].size() == 2);
  CHECK(answer["posterior"]["a"][0].get<double>() + answer["posterior"]["a"][1].get<double>() == Approx(6));
}

TEST_CASE("the answer to a mixture line is the library's, to the last bit") {
  const json answer = ask(kGood);
  const MixtureUpdate expected =
      mixture_update(std::vector<double>{1, 3}, std::vector<Nig>{{0.4, 50, 25, 0.1}, {0.2, 5, 2, 0.02}}, 0.3);
  CHECK(answer["log_evidence"].get<double>() == expected.responsibility.log_evidence);
  for (size_t c = 0; c < 2; ++c) {
    CHECK(answer["responsibility"][c].get<double>() == expected.responsibility.p[c]);
    CHECK(answer["posterior"]["a"][c].get<double>() == expected.a[c]);
    CHECK(answer["posterior"]["kappa"][c].get<double>() == expected.nig[c].kappa);
  }
}

TEST_CASE("bare numbers in the prior are one class, whose concentration may be left out") {
  const json answer =
      ask(R"({"prior": {"tau": 0.4, "kappa": 1, "beta": 5, "gamma": 0.01}, "psi": 0.25, "sigma": 0.05, "extra": {}})");
  CHECK(answer["responsibility"] == json{1.0});
  CHECK(answer["posterior"]["a"] == json{2.0});
}

TEST_CASE("a class whose entries are null takes no part and stays null") {
  const json answer = ask(
      R"({"prior": {"a": [1, 2, 5], "tau": [0.4, null, 0.1], "kappa": [1, null, 1], "beta": [5, null, 5], "gamma": [0.01, null, 0.01]}, "psi": 0.3})");
  CHECK(answer["responsibility"][1] == 0.0);
  CHECK(answer["posterior"]["tau"][1].is_null());
  CHECK(answer["responsibility"][0].get<double>() + answer["responsibility"][2].get<double>() == Approx(1));
}

TEST_CASE("a line nested without end is an unusable line, not the end of the program") {
  const std::string many(200000, '['), closed(200000, ']');
  for (const std::string& line : {many + closed, "{\"psi\": 1, \"prior\": " + many + closed + "}", many}) {
    const json answer = ask(line);
    CHECK_THAT(answer.at("error").get<std::string>(), Catch::Contains("deep"));
    CHECK(answer.at("line") == 7);
  }
  CHECK_FALSE(ask(good_with("/comment", "[[[\\\"[").dump()).contains("error"));
}

TEST_CASE("an unusable line is answered with its number and the field at fault") {
  struct Case {
    std::string line, field;
  };
  std::string nan_reading = kGood, huge = kGood;
  nan_reading.replace(nan_reading.find("0.3}"), 3, "NaN");
  huge.replace(huge.find("0.1, 0.02"), 3, "1e999");
  const std::vector<Case> cases{
      {nan_reading, "psi: "},
      {huge, "prior.gamma[0]: "},
      {good_with("/prior/kappa/1", -1).dump(), "prior.kappa[1]: "},
      {good_with("/prior/beta/0", 0).dump(), "prior.beta[0]: "},
      {good_with("/prior/tau/0", "x").dump(), "prior.tau[0]: "},
      {good_with("/prior/tau/0", nullptr).dump(), "prior.tau[0]: "},
      {good_with("/prior/gamma", {1, 2, 3}).dump(), "prior.gamma: "},
      {good_with("/prior/a", {1}).dump(), "prior.a: "},
      {good_with("/sigma", -0.1).dump(), "sigma: "},
      {good_with("/sigma", {0.1}).dump(), "sigma: "},
      {good_with("/rho", 1).dump(), "rho: "},
      {good_with("/rho", -0.1).dump(), "rho: "},
      {good_with("/projection", "other").dump(), "projection: "},
      {good_with("/model", "other").dump(), "model: "},
      {good_with("/model", "mixture").patch(json::parse(R"([{"op":"replace","path":"/psi","value":[1,2]}])")).dump(),
       "psi: "},
      {good_with("/prior", {{"a", json::array()},
                            {"tau", json::array()},
                            {"kappa", json::array()},
                            {"beta", json::array()},
                            {"gamma", json::array()}})
           .dump(),
       "prior.tau: "},
      {R"({"psi": 0.3})", "prior: "},
      {R"({"prior": {"tau": [1]}})", "psi: "},
      {R"({"prior": {"tau": [1]}, "psi": 1})", "prior.kappa: "},
      {R"({"prior": 3, "psi": 1})", "prior: "},
      {R"({"prior": )", "line: "},
      {R"([1, 2])", "line: "},
      {"", "line: "},
      {"\xff\xfe garbage", "line: "},
  };
  for (const Case& c : cases) {
    INFO(c.line);
    const InferAnswer answer = infer_json_line(c.line, 42);
    CHECK(answer.failed);
    const json parsed = json::parse(answer.json);
    CHECK(parsed["line"] == 42);
    CHECK_THAT(parsed["error"].get<std::string>(), Catch::Matchers::StartsWith(c.field));
  }
}

TEST_CASE("single precision rounds what goes in and refuses what it cannot hold") {
  const json twice = json::parse(infer_json_line(kGood, 1, InferPrecision::f32).json), once = ask(kGood);
  const double exact = once["log_evidence"], single = twice["log_evidence"];
  CHECK(single != exact);
  CHECK(single == Approx(exact).epsilon(1e-5));
  CHECK(infer_json_line(good_with("/prior/gamma/0", 1e-50).dump(), 1, InferPrecision::f32).failed);
  CHECK_FALSE(infer_json_line(good_with("/prior/gamma/0", 1e-50).dump(), 1).failed);
}

TEST_CASE("a prediction gives null with the reason for what does not exist") {
  const json answer = ask(
      R"({"model": "predict", "prior": {"a": [1, 2], "tau": [0, 1], "kappa": [1, 1], "beta": [0.4, 1], "gamma": [1, 1]}, "quantiles": [0.5], "cvar": [0.1], "below": [0.5]})");
  CHECK(answer["mean"].is_null());
  CHECK(answer["cvar_upper"][0].is_null());
  CHECK(answer["reason"].contains("mean"));
  CHECK(answer["reason"].contains("variance"));
  CHECK_FALSE(answer["reason"].contains("quantiles"));
  CHECK(answer["quantiles"][0].is_number());
  CHECK(answer["information_gain"]["value"].get<double>() > 0);
}

}  // namespace felt
