#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "core/error.h"

namespace felt::apps {

/// What `read` makes of words of the command line. What it finds wrong with them is a fault of usage (exit code 2) and
/// neither one of the configuration nor of a file.
template <typename Read>
auto of_command_line(const Read& read) {
  try {
    return read();
  } catch (const Error& fault) {
    throw CLI::ValidationError(fault.what());
  }
}

/// What is wrong with what a command was told, kept so that all of it is named at once.
class Problems {
public:
  /// A setting that cannot be used.
  void add(const std::string& message) { messages_.push_back(message); }
  /// What is missing on the command line, or cannot be read.
  void add_of_usage(const std::string& message) {
    add(message);
    of_usage_ = true;
  }
  void expect(bool good, const std::string& where, const std::string& what, const std::string& expected,
              const std::string& found) {
    if (!good) add(describe_mismatch(where, what, expected, found));
  }
  /// Runs a check of settings and keeps what it found; whether that is nothing.
  template <typename Check>
  bool attempt(const Check& check) {
    try {
      check();
      return true;
    } catch (const ConfigError& fault) {
      add(fault.what());
      return false;
    }
  }
  /// The same of a step that reads words of the command line (`of_command_line`).
  template <typename Read>
  bool attempt_reading(const Read& read) {
    try {
      read();
      return true;
    } catch (const Error& fault) {
      add_of_usage(fault.what());
      return false;
    }
  }
  /// Throws all of it: CLI::ValidationError where any is of usage, else ConfigError.
  void throw_if_any() const {
    if (messages_.empty()) return;
    const ConfigError all(messages_);
    if (of_usage_) throw CLI::ValidationError(all.what());
    throw all;
  }

private:
  std::vector<std::string> messages_;
  bool of_usage_ = false;
};

}  // namespace felt::apps
