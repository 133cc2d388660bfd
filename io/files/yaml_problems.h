#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace YAML {
class Node;
}

namespace felt {

/// Gathers everything that is wrong with a YAML file, so that it can be said at once.
class YamlProblems {
public:
  explicit YamlProblems(std::filesystem::path file) : file_(std::move(file)) {}

  /// Adds "<file>:<line of `at`>: <what>: expected <expected>, found <found>".
  void problem(const YAML::Node& at, const std::string& what, const std::string& expected, const std::string& found);
  /// Adds a problem for each key of a table that is not `known`.
  void refuse_unknown(const YAML::Node& table, const std::set<std::string>& known);

  std::vector<std::string> problems;

private:
  std::filesystem::path file_;
};

}  // namespace felt
