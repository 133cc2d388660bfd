#pragma once

#include <string>

namespace felt::test {

/// What one run of the feltmap command gave.
struct CommandResult {
  int exit_code = -1;  ///< 128 + signal where a signal ended it
  std::string out;
  std::string err;
};

/// Runs `feltmap <arguments>` through the shell (quote what needs it) with empty stdin and waits for it. `before` and
/// `after` are pieces of shell around the command, for limits and signals.
CommandResult run_feltmap(const std::string& arguments, const std::string& before = "", const std::string& after = "");

}  // namespace felt::test
