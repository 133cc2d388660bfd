#include "core/error.h"

namespace felt {
namespace {

std::string join_lines(const std::vector<std::string>& lines) {
  std::string all;
  for (const std::string& line : lines) {
    if (!all.empty()) all += '\n';
    all += line;
  }
  return all;
}

}  // namespace

ConfigError::ConfigError(const std::vector<std::string>& problems) : Error(join_lines(problems)) {}

std::string describe_mismatch(const std::string& where, const std::string& what, const std::string& expected,
                              const std::string& found) {
  return where + ": " + what + ": expected " + expected + ", found " + found;
}

}  // namespace felt
