#pragma once

#include <set>
#include <string>
#include <vector>

namespace YAML {
class Exception;
class Node;
}  // namespace YAML

namespace felt {

/// What cannot be parsed or converted: "<where>:<line>: <the parser's words>", with `what` before these where given.
std::string yaml_fault(const std::string& where, const YAML::Exception& fault, const std::string& what = "");

/// Gathers everything that is wrong with a YAML document, so that it can be said at once.
class YamlProblems {
public:
  /// `where`: the document's file.
  explicit YamlProblems(std::string where) : where_(std::move(where)) {}

  /// "<where>:<line of the node>"; for an undefined node, of the table that `refuse_unknown` looked at last.
  std::string place(const YAML::Node& node) const;
  /// Adds "<place of `at`>: <what>: expected <expected>, found <found>".
  void problem(const YAML::Node& at, const std::string& what, const std::string& expected, const std::string& found);
  /// The same where what `at` holds was found.
  void problem(const YAML::Node& at, const std::string& what, const std::string& expected);
  /// Adds a problem for each key of a table that is not `known`, and for one that comes again.
  void refuse_unknown(const YAML::Node& table, const std::set<std::string>& known);
  /// Adds a problem for each key that comes again: YAML keeps the first, and which one was meant nobody knows.
  void refuse_repeated(const YAML::Node& table);

  std::vector<std::string> problems;

private:
  std::string where_;
  int table_line_ = 1;
};

}  // namespace felt
