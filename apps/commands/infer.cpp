#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "apps/options/problems.h"
#include "apps/output/output_files.h"
#include "core/error.h"
#include "core/simd.h"
#include "core/text.h"
#include "io/files/atomic_file.h"
#include "io/readings/fit_priors.h"
#include "io/readings/infer_json.h"
#include "io/readings/infer_plot.h"
#include "io/tables/property_yaml.h"

namespace felt::apps {
namespace {

constexpr size_t kMostPlotted = 20;

struct InferOptions : CommonOptions {
  InferPrecision precision = InferPrecision::f64;
  std::string simd;
  std::string plot;
  std::string fit_priors;
  bool overwrite = false;  ///< of properties_out
  std::string properties_out, property = "friction", unit = "1";
  std::vector<double> support;  ///< of the property: lo, hi
  double max_nu_0 = kDefaultPriorReadings;
};

int run_fit(const InferOptions& options) {
  const std::vector<ClassReadings> readings = read_readings_csv(options.fit_priors);
  if (!options.properties_out.empty()) {
    Property property;
    property.name = options.property;
    property.unit = options.unit;
    property.max_prior_readings = options.max_nu_0;
    if (!options.support.empty()) property.support_lo = options.support[0], property.support_hi = options.support[1];
    write_file_atomically(options.properties_out, properties_yaml(fitted_properties(readings, property)));
  }
  std::cout << fit_priors_json(readings, options.max_nu_0) << '\n';
  return kDone;
}

int run_infer(const InferOptions& options) {
  require_ending(options.plot, ".svg");
  require_ending(options.properties_out, ".yaml");
  if (!options.properties_out.empty()) require_no_file(options.properties_out, options.overwrite);
  if (!options.support.empty() && !(options.support[0] < options.support[1]))
    throw CLI::ValidationError(
        describe_mismatch("--support", "range", "two numbers, the smaller one first",
                          number_text(options.support[0]) + " and " + number_text(options.support[1])));
  if (!options.simd.empty()) of_command_line([&] { choose_simd(options.simd, "--simd"); });
  if (!options.fit_priors.empty()) return run_fit(options);
  std::ios::sync_with_stdio(false);
  size_t number = 0, faulty = 0;
  std::vector<Plot> panels;
  for (std::string line; std::cout && std::getline(std::cin, line);) {
    const InferAnswer answer = infer_json_line(line, ++number, options.precision);
    std::cout << answer.json << '\n';
    faulty += answer.failed;
    if (!options.plot.empty() && !answer.failed && number <= kMostPlotted) {
      for (Plot& panel : infer_plots(line, "line " + std::to_string(number))) panels.push_back(std::move(panel));
    }
  }
  std::cout.flush();
  if (!std::cout) throw IoError("stdout: cannot write the answers");
  if (!options.plot.empty()) write_plot_svg(options.plot, panels, 2);
  // Faulty lines are answered in place, so the command itself has done its job.
  if (faulty > 0) spdlog::warn("infer: {} of {} lines were faulty", faulty, number);
  return kDone;
}

}  // namespace

void add_infer(CLI::App& app) {
  auto options = std::make_shared<InferOptions>();
  CLI::App& command = add_command(
      app,
      {"infer", "Answer touch updates, one JSON document a line from stdin to stdout, without a map",
       R"(echo '{"prior": {"alpha": [1, 1], "tau": [0.39, 0.19], "kappa": [50, 50], "beta": [25, 25], "gamma": [0.126, 0.053]}, "rho": 0.5, "psi": [0.15]}' | feltmap infer)"},
      *options, [options] { return run_infer(*options); });
  const std::map<std::string, InferPrecision> precisions = {{"f64", InferPrecision::f64}, {"f32", InferPrecision::f32}};
  add_choice(command, "--precision", options->precision, precisions,
             "f64: the functions that specify the models; f32: the batch kernels, of which maps run those of mixture")
      ->default_str(name_of(precisions, options->precision));
  CLI::Option* plot = command.add_option("--plot", options->plot,
                                         "Write an SVG with the density of the next reading, elsewhere in the class, "
                                         "before and after each of the first 20 "
                                         "lines");
  CLI::Option* fit =
      command.add_option("--fit-priors", options->fit_priors,
                         "Instead: fit priors to the readings of a CSV (class, group, value) and print them as JSON");
  command
      .add_option("--properties-out", options->properties_out,
                  "With --fit-priors: write the priors to this properties.yaml too")
      ->needs(fit);
  command.add_option("--property", options->property, "Name of the property in --properties-out")
      ->needs("--properties-out")
      ->capture_default_str();
  command.add_option("--unit", options->unit, "Unit of the property in --properties-out")
      ->needs("--properties-out")
      ->capture_default_str();
  command
      .add_option("--support", options->support,
                  "Least and largest value of the property in --properties-out: 0,inf for friction [all numbers]")
      ->delimiter(',')
      ->expected(2)
      ->allow_extra_args(false)
      ->needs("--properties-out");
  command.add_flag("--force", options->overwrite, "Replace --properties-out where it exists")
      ->needs("--properties-out");
  command.add_option("--max-nu", options->max_nu_0, "Most readings that a fitted prior may stand for")
      ->check(above_zero())
      ->needs(fit)
      ->capture_default_str();
  fit->excludes(plot)->excludes("--precision");
  command.add_option("--simd", options->simd, "Target of the kernels: scalar, sse4, avx2, avx3 (best one if absent)")
      ->excludes(fit);
}

}  // namespace felt::apps
