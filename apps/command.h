#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

namespace felt::apps {

/// Options that every command takes.
struct CommonOptions {
  bool quiet = false;              ///< no progress bar, no closing summary
  bool json = false;               ///< one JSON document on stdout and nothing else there
  int threads = 0;                 ///< 0: all hardware threads
  std::string log_level = "warn";  ///< of messages on stderr

  /// Threads that the command runs on: `threads`, or what the machine has.
  int thread_count() const;
};

/// What a command is made of besides its own options.
struct CommandText {
  std::string name;
  std::string description;  ///< one sentence
  std::string example;      ///< complete command lines, one a line, shown at the end of the help
};

/// Adds a subcommand with the common options bound to `common`. When it is chosen and its options are valid, logging
/// and the number of threads are set up and `run` is called; its return value is the exit code. Errors leave `run` as
/// exceptions (core/error.h).
CLI::App& add_command(CLI::App& app, const CommandText& text, CommonOptions& common, std::function<int()> run);

/// A flag that is absent, not false, where it is not given, so that it overrules what a file says only where it is.
/// `--x` makes it `meaning`, `--x=false` the opposite. CLI11's own negated flags ("!--no-x") throw what is no usage
/// error where their value is too large a number.
CLI::Option* add_switch(CLI::App& command, const std::string& name, std::optional<bool>& value, const std::string& text,
                        bool meaning = true);

/// An option that is given as one of `names`: help and errors list them. `value`: an Enum, or an optional of it.
template <typename Enum, typename Value>
CLI::Option* add_choice(CLI::App& command, const std::string& option, Value& value,
                        const std::map<std::string, Enum>& names, const std::string& text) {
  return command
      .add_option_function<std::string>(
          option, [&value, names](const std::string& name) { value = names.at(name); }, text)
      ->check(CLI::IsMember(names));
}

/// The name of a choice.
template <typename Enum>
std::string name_of(const std::map<std::string, Enum>& names, Enum value) {
  for (const auto& [name, candidate] : names)
    if (candidate == value) return name;
  return {};
}

/// A document on stdout, indented.
void print_json(const nlohmann::ordered_json& document);

}  // namespace felt::apps
