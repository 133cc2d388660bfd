#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/simd.h"
#include "io/tables/property_yaml.h"
#include "tests/cli/command.h"
#include "tests/support/inference_cases.h"

namespace felt::test {
namespace {

using nlohmann::json;

std::vector<json> lines_of(const std::string& text) {
  std::vector<json> lines;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines.push_back(json::parse(line));
  return lines;
}

std::string text_of(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

}  // namespace

TEST_CASE("infer answers every line in order and goes on after a faulty one") {
  const std::string good = R"({"prior": {"tau": 0.4, "kappa": 50, "beta": 25, "gamma": 0.1}, "psi": 0.3})";
  const CommandResult result = run_feltmap("infer", good + "\nnot json\n" + good + "\n");
  CHECK(result.exit_code == 0);
  const std::vector<json> answers = lines_of(result.out);
  REQUIRE(answers.size() == 3);
  CHECK(answers[0] == answers[2]);
  CHECK(answers[1]["line"] == 2);
  CHECK(answers[1]["error"].is_string());
  // So do numbers that no function has a value for.
  const std::string vague =
      R"({"prior":{"a":[1e-30,1e-30],"tau":[0.4,0.5],"kappa":[50,50],"beta":[25,25],"gamma":[0.1,0.1]},"psi":0.45})";
  const std::vector<json> both = lines_of(run_feltmap("infer", vague + "\n" + good + "\n").out);
  REQUIRE(both.size() == 2);
  CHECK(both[0]["line"] == 1);
  CHECK(both[1] == answers[0]);
}

TEST_CASE("infer takes the lines of all three golden files and answers with their numbers") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  const auto dnig = read_json_lines(reference / "dnig_golden.jsonl", 160);
  const auto material = read_json_lines(reference / "material_golden.jsonl", 80);
  const auto noise = read_json_lines(reference / "noise_golden.jsonl", 30);
  const CommandResult result =
      run_feltmap("infer", text_of(reference / "dnig_golden.jsonl") + text_of(reference / "material_golden.jsonl") +
                               text_of(reference / "noise_golden.jsonl"));
  CHECK(result.exit_code == 0);
  const std::vector<json> answers = lines_of(result.out);
  REQUIRE(answers.size() == dnig.size() + material.size() + noise.size());
  for (size_t i = 0; i < answers.size(); ++i) {
    INFO("line " << i + 1);
    REQUIRE_FALSE(answers[i].contains("error"));
    if (i < dnig.size()) {
      CHECK(answers[i]["log_evidence"].get<double>() == Approx(dnig[i]["log_evidence"].get<double>()).epsilon(1e-9));
      CHECK(answers[i]["posterior"]["beta"][0].get<double>() ==
            Approx(dnig[i]["kl"]["beta"][0].get<double>()).epsilon(1e-7));
    } else if (i < dnig.size() + material.size()) {
      const json& expected = material[i - dnig.size()];
      CHECK(answers[i]["surprise"].get<double>() == Approx(expected["surprise"].get<double>()).epsilon(1e-9));
      CHECK(answers[i]["classes"][1]["next_scale2"].get<double>() ==
            Approx(expected["classes"][1]["next_scale2"].get<double>()).epsilon(1e-7));
    } else {
      const json& line = noise[i - dnig.size() - material.size()];
      const double v = line["prior"]["gamma"].get<double>() / line["prior"]["beta"].get<double>();
      const double sigma = line["sigma"];
      // Above a third of the class variance always by quadrature, below in closed form where that errs little.
      const double margin = sigma * sigma > v / 3 ? 1e-9 : 0.03;
      CHECK(answers[i]["log_evidence"].get<double>() == Approx(line["log_evidence"].get<double>()).margin(margin));
    }
  }
}

TEST_CASE("infer draws densities and fits priors") {
  const TemporaryDirectory directory;
  const auto svg = directory.path() / "out.svg", csv = directory.path() / "readings.csv";
  const std::string line = R"({"prior": {"tau": 0.4, "kappa": 50, "beta": 25, "gamma": 0.1}, "psi": 0.3})";
  CHECK(run_feltmap("infer --plot '" + svg.string() + "'", line + "\n").exit_code == 0);
  CHECK(text_of(svg).substr(0, 4) == "<svg");
  std::ofstream(csv) << "class,group,value\nice,a,0.1\nice,a,0.2\nice,b,0.3\nice,b,0.2\n";
  const CommandResult fitted = run_feltmap("infer --fit-priors '" + csv.string() + "'");
  CHECK(fitted.exit_code == 0);
  CHECK(json::parse(fitted.out)["classes"][0]["mean"].get<double>() == Approx(0.2));
  CHECK(run_feltmap("infer --fit-priors /no/such/file").exit_code == 4);
}

TEST_CASE("fitted priors are written as properties that a map takes, beside the table of what one touch cannot tell") {
  const TemporaryDirectory directory;
  const auto csv = directory.path() / "readings.csv", yaml = directory.path() / "properties.yaml";
  std::ofstream(csv) << "class,group,value\nice,a,0.10\nice,a,0.12\nice,b,0.14\nice,b,0.16\n"
                        "mud,a,0.11\nmud,b,0.13\nmud,b,0.15\nrock,a,0.5\nrock,a,0.52\nrock,b,0.6\nrock,b,0.58\n";
  const CommandResult fitted =
      run_feltmap("infer --fit-priors '" + csv.string() + "' --property mu --properties-out '" + yaml.string() + "'");
  REQUIRE(fitted.exit_code == 0);
  const json report = json::parse(fitted.out);
  REQUIRE(report["inseparable"].size() == 1);
  CHECK(report["inseparable"][0]["classes"] == json({"ice", "mud"}));
  const PropertyTable table = read_properties(yaml);
  REQUIRE(table.size() == 1);
  CHECK(table[0].name == "mu");
  CHECK(table[0].rho == Approx(report["rho"].get<double>()));
  CHECK(table[0].priors.at("ice").mean == Approx(0.13));
  CHECK(table[0].priors.at("rock").sd == Approx(report["classes"][2]["sd"].get<double>()));
  const std::string again = "infer --fit-priors '" + csv.string() + "' --properties-out '" + yaml.string() + "'",
                    before = text_of(yaml);
  CHECK(run_feltmap(again).exit_code == 4);
  CHECK(text_of(yaml) == before);
  CHECK(run_feltmap(again + " --force").exit_code == 0);
  CHECK(text_of(yaml) != before);
  CHECK(run_feltmap("infer --fit-priors '" + csv.string() + "' --properties-out /no/such/dir/p.yaml").exit_code == 4);
}

TEST_CASE("infer in single precision runs the batch kernels on the target it is told, within 1e-3 of the reference") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  const auto dnig = read_json_lines(reference / "dnig_golden.jsonl", 160);
  const auto material = read_json_lines(reference / "material_golden.jsonl", 80);
  const std::string lines = text_of(reference / "dnig_golden.jsonl") + text_of(reference / "material_golden.jsonl");
  for (const std::string& target : simd_names()) {
    INFO(target);
    const CommandResult result = run_feltmap("infer --precision f32 --simd " + target, lines);
    REQUIRE(result.exit_code == 0);
    const std::vector<json> answers = lines_of(result.out);
    REQUIRE(answers.size() == dnig.size() + material.size());
    double worst = 0;
    for (size_t i = 0; i < dnig.size(); ++i) {
      const json &expected = dnig[i]["kl"], &found = answers[i]["posterior"];
      REQUIRE(answers[i]["valid"] == true);
      for (size_t c = 0; c < expected["beta"].size(); ++c)
        for (const char* field : {"kappa", "beta", "gamma"})
          worst = std::max(worst, relative_error(found[field][c].get<double>(), expected[field][c].get<double>()));
    }
    CHECK(worst < 1e-3);
    CHECK((target == "scalar" || worst > 1e-8));  // not the f64 answer
    double worst_class = 0;
    for (size_t i = 0; i < material.size(); ++i) {
      const json& found = answers[dnig.size() + i]["class_probability"];
      for (size_t c = 0; c < found.size(); ++c)
        worst_class =
            std::max(worst_class, std::abs(found[c].get<double>() - material[i]["class_probability"][c].get<double>()));
    }
    CHECK(worst_class < 1e-3);
  }
}

TEST_CASE("a faulty line names its field and its number, whatever is wrong with it") {
  const std::string ok =
      R"({"prior": {"a": [1, 1], "tau": [0, 1], "kappa": [1, 1], "beta": [1, 1], "gamma": [1, 1]}, )";
  const std::pair<std::string, std::string> faulty[] = {
      {R"({"prior": {"a": [1, 0], "tau": [0, 1], "kappa": [1, 1], "beta": [1, 1], "gamma": [1, 1]}, "psi": 1})",
       "prior.a[1]"},
      {R"({"prior": {"a": [1, 1], "tau": [0, 1], "kappa": [1, -1], "beta": [1, 1], "gamma": [1, 1]}, "psi": 1})",
       "prior.kappa[1]"},
      {R"({"prior": {"a": [1, 1], "tau": [0, 1], "kappa": [1, 1], "beta": [NaN, 1], "gamma": [1, 1]}, "psi": 1})",
       "prior.beta[0]"},
      {R"({"prior": {"a": [1, 1], "tau": [0, 1], "kappa": [1, 1], "beta": [1, 1], "gamma": [1]}, "psi": 1})",
       "prior.gamma"},
      {R"({"prior": {"a": [], "tau": [], "kappa": [], "beta": [], "gamma": []}, "psi": 1})", "prior.tau"},
      {ok + R"("psi": NaN})", "psi"},
      {ok + R"("psi": 1e999})", "psi"},
      {ok + R"("psi": 1, "sigma": -0.1})", "sigma"},
      {ok + R"("psi": [1], "rho": 1})", "rho"},
      {ok + R"("psi": [1], "rho": -0.1})", "rho"},
      {ok + R"("psi": [1, 2], "sigma": [0.1]})", "sigma"},
      {ok + R"("psi": 1, "projection": "both"})", "projection"},
      {ok + R"("psi": 1)", "line"},
      {R"([1, 2])", "line"},
      {R"({"psi": 1})", "prior"},
  };
  std::string input;
  for (const auto& [line, field] : faulty) input += line + "\n";
  for (const char* precision : {"f64", "f32"}) {
    const CommandResult result =
        run_feltmap("infer --precision " + std::string(precision), input + ok + "\"psi\": 1}\n");
    CHECK(result.exit_code == 0);
    const std::vector<json> answers = lines_of(result.out);
    REQUIRE(answers.size() == std::size(faulty) + 1);
    for (size_t i = 0; i < std::size(faulty); ++i) {
      INFO(faulty[i].first);
      REQUIRE(answers[i].contains("error"));
      CHECK(answers[i]["error"].get<std::string>().rfind(faulty[i].second + ":", 0) == 0);
      CHECK(answers[i]["line"] == i + 1);
    }
    CHECK(answers.back()["valid"] == true);
  }
}

TEST_CASE("infer refuses a precision or a target that it does not know") {
  const CommandResult half = run_feltmap("infer --precision f16");
  CHECK(half.exit_code == 2);
  CHECK_THAT(half.err, Catch::Matchers::Contains("f16 not in {f32,f64}"));
  CHECK(run_feltmap("infer --simd sideways").exit_code == 2);
}

}  // namespace felt::test
