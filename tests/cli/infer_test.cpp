#include <catch2/catch.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

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
}

TEST_CASE("infer takes the lines of all three golden files and answers with their numbers") {
  FELTMAP_REQUIRE_DATA(reference, "../reference");
  const auto dnig = read_json_lines(reference / "dnig_golden.jsonl");
  const auto material = read_json_lines(reference / "material_golden.jsonl");
  const auto noise = read_json_lines(reference / "noise_golden.jsonl");
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

TEST_CASE("infer refuses a precision or a target that it does not know") {
  CHECK(run_feltmap("infer --precision f16").exit_code == 2);
  CHECK(run_feltmap("infer --simd sideways").exit_code == 3);
}

}  // namespace felt::test
