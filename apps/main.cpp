#include <CLI/CLI.hpp>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <memory>
#include <new>
#include <sstream>
#include <string>
#include <vector>

#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "core/error.h"
#include "core/simd.h"
#include "core/text.h"
#include "io/files/system_memory.h"

namespace felt::apps {
namespace {

/// Each line of the message on stderr under the program's name.
int fail(ExitCode code, const std::string& message) {
  std::istringstream lines(message);
  for (std::string line; std::getline(lines, line);) std::fprintf(stderr, "feltmap: error: %s\n", line.c_str());
  return code;
}

/// CLI11's help, but for the lists of options that an option excludes: touch has 6 kB of them.
class HelpFormatter final : public CLI::Formatter {
public:
  std::string make_option_opts(const CLI::Option* option) const override {
    const std::string text = CLI::Formatter::make_option_opts(option);
    return text.substr(0, text.find(" " + get_label("Excludes") + ":"));
  }
};

void add_commands(CLI::App& app) {
  app.require_subcommand(1);
  app.set_version_flag("--version", [] { return "feltmap " FELTMAP_VERSION " (SIMD: " + simd_name() + ")"; });
  add_reconstruct(app);
  add_doctor(app);
  add_segment(app);
  add_info(app);
  add_convert(app);
  add_export(app);
  add_simulate(app);
  add_render(app);
  add_evaluate(app);
  add_calibrate_labels(app);
  add_touch(app);
  add_region(app);
  add_query(app);
  add_suggest(app);
  add_friction(app);
  add_merge(app);
  add_diff(app);
  add_verify(app);
  add_infer(app);
  add_bench(app);
  app.footer("Each command explains itself, with an example: feltmap <command> --help");
}

/// The code, or that of a failure where what was printed did not arrive.
int written(int code) {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return code;
  return fail(kInputOutput, "standard output: cannot be written");
}

/// The first word that is empty (a list of nothing, ",", too) or gives an option nothing ("--out="), as a shell makes
/// of a variable that is not set, with its option; else nothing. CLI11 would take the next word for the value, and
/// commands an empty one for none.
std::string word_without_value(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i], before = argv[i - 1];
    if (word.starts_with("--") && word.ends_with('=')) return word;
    if (word.find_first_not_of(',') == std::string::npos)
      return (before.starts_with("--") ? before + " " : "") + '"' + word + '"';
  }
  return "";
}

/// Names of the command's options without dashes, those in groups of it too.
std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options())
    names.insert(names.end(), option->get_lnames().begin(), option->get_lnames().end());
  for (const CLI::App* group : command.get_subcommands({})) {
    if (!group->get_name().empty()) continue;
    const std::vector<std::string> more = option_names(*group);
    names.insert(names.end(), more.begin(), more.end());
  }
  return names;
}

/// What is wrong with the first option that the command does not have and that is nearly one of its own; empty where
/// there is none.
std::string misspelt_option(const CLI::App& command) {
  for (const std::string& word : command.remaining(true)) {
    if (!word.starts_with("--")) continue;
    const std::string name = word.substr(2, word.find('=') - 2), near = nearest_word(name, option_names(command));
    if (!near.empty()) return describe_mismatch(command.get_name(), "option", "'--" + near + "'", "'--" + name + "'");
  }
  return "";
}

int run(int argc, char** argv) {
  CLI::App app("Dense volumetric mapping that knows what things are and how they feel", "feltmap");
  app.formatter(std::make_shared<HelpFormatter>());
  add_commands(app);
  if (const std::string word = word_without_value(argc, argv); !word.empty())
    return fail(kUsage, "'" + word + "': expected a value, found none (see feltmap --help)");
  try {
    app.parse(argc, argv);
    return written(kDone);
  } catch (const CLI::RuntimeError& e) {
    return written(e.get_exit_code());
  } catch (const CLI::Success& e) {
    return written(app.exit(e));  // --help, --version
  } catch (const CLI::ParseError& e) {
    // CLI11 would only say that a subcommand is missing.
    const std::vector<std::string> unknown = app.remaining();
    if (app.get_subcommands().empty() && !unknown.empty())
      return fail(kUsage, "'" + unknown.front() + "': expected one of " +
                              listed(app.get_subcommands({}), &CLI::App::get_name) + " (see feltmap --help)");
    const CLI::App& command = app.get_subcommands().empty() ? app : *app.get_subcommands().front();
    const std::string misspelt = misspelt_option(command);
    return fail(kUsage, (misspelt.empty() ? e.what() : misspelt) + " (see feltmap --help)");
  }
}

}  // namespace
}  // namespace felt::apps

/// The only place that turns errors into exit codes.
int main(int argc, char** argv) {
  using namespace felt::apps;
  try {
    felt::keep_freed_memory();
    felt::apply_simd_choice();
    return run(argc, argv);
  } catch (const felt::ConfigError& e) {
    return fail(kConfiguration, e.what());
  } catch (const felt::Error& e) {
    return fail(kInputOutput, e.what());
  } catch (const std::filesystem::filesystem_error& e) {
    return fail(kInputOutput, e.path1().string() + ": " + e.code().message());
  } catch (const std::bad_alloc&) {
    return fail(kInternal, "out of memory");
  } catch (const std::exception& e) {
    return fail(kInternal, e.what());
  }
}
