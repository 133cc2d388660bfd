#include <cstdio>
#include <memory>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "io/map_file/map_diff_report.h"
#include "io/map_file/map_file.h"

namespace felt::apps {
namespace {

struct Options {
  CommonOptions common;
  std::string a, b;
  double tolerance = 0;
};

int run(const Options& options) {
  const MapDifference d = difference(load_map(options.a), load_map(options.b));
  const bool differs = beyond(d, options.tolerance);
  const bool same_texts = d.settings.empty() && d.undone_only_a + d.undone_only_b == 0;
  if (options.common.json) {
    std::printf("%s\n", to_json(d, options.a, options.b, options.tolerance).c_str());
  } else if (!options.common.quiet) {
    std::printf("%s%s\n", to_text(d).c_str(),
                differs        ? "different"
                : !d.same_hash ? "equal within tolerance"
                : same_texts   ? "identical"
                               : "identical values");
  }
  return differs ? kDifferent : kDone;
}

}  // namespace

void add_diff(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  CLI::App& command =
      add_command(app,
                  {"diff", "Compare two maps grid by grid; exits 1 where they differ beyond the tolerance",
                   "feltmap diff a/map.vdb b/map.vdb\nfeltmap diff a/map.vdb b/map.vdb --tol 1e-5 --json"},
                  options->common, [options] { return run(*options); });
  command.add_option("A", options->a, "Map file")->required();
  command.add_option("B", options->b, "Map file")->required();
  command
      .add_option("--tol", options->tolerance,
                  "Greatest difference of a value that counts as equal, in the grid's own unit (metres, weight, grey "
                  "levels, counts)")
      ->check(at_least_zero())
      ->capture_default_str();
}

}  // namespace felt::apps
