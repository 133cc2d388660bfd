#include "tests/cli/command.h"

#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/support/data.h"

namespace felt::test {

std::string file_text(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

CommandResult run_feltmap(const std::string& arguments, const std::string& input) {
  return run_feltmap_within("", arguments, "", input);
}

CommandResult run_feltmap_within(const std::string& before, const std::string& arguments, const std::string& after,
                                 const std::string& input) {
  const TemporaryDirectory directory;
  const auto in = directory.path() / "in", out = directory.path() / "out", err = directory.path() / "err";
  std::ofstream(in, std::ios::binary) << input;
  const std::string line = before + "'" + command().string() + "' " + arguments + " < '" + in.string() + "' > '" +
                           out.string() + "' 2> '" + err.string() + "'" + after;
  const int status = std::system(line.c_str());
  CommandResult result;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = file_text(out);
  result.err = file_text(err);
  return result;
}

}  // namespace felt::test
