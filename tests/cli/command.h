#pragma once

#include <filesystem>
#include <string>

namespace felt::test {

/// What one run of the feltmap command gave.
struct CommandResult {
  int exit_code = -1;  ///< 128 + signal where a signal ended it
  std::string out;
  std::string err;
};

/// Runs `feltmap <arguments>` through the shell (quote what needs it) with `input` on stdin and waits for it.
CommandResult run_feltmap(const std::string& arguments, const std::string& input = "");
/// The same with pieces of shell around the command, for limits and signals.
CommandResult run_feltmap_within(const std::string& before, const std::string& arguments, const std::string& after = "",
                                 const std::string& input = "");

/// All bytes of a file; empty where there is none.
std::string file_text(const std::filesystem::path& file);

}  // namespace felt::test
