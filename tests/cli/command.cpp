#include "tests/cli/command.h"

#include <sys/wait.h>

#include <cstdlib>
#include <fstream>
#include <sstream>

#include "tests/support/data.h"

namespace felt::test {
namespace {

std::string file_text(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

}  // namespace

CommandResult run_feltmap(const std::string& arguments, const std::string& input) {
  const TemporaryDirectory directory;
  const auto in = directory.path() / "in", out = directory.path() / "out", err = directory.path() / "err";
  std::ofstream(in, std::ios::binary) << input;
  const std::string line = felt::test::command().string() + " " + arguments + " < '" + in.string() + "' > '" +
                           out.string() + "' 2> '" + err.string() + "'";
  const int status = std::system(line.c_str());
  CommandResult result;
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  result.out = file_text(out);
  result.err = file_text(err);
  return result;
}

}  // namespace felt::test
