#include "io/files/yaml_problems.h"

#include <yaml-cpp/yaml.h>

#include "core/error.h"
#include "core/text.h"

namespace felt {
namespace {

std::string content_of(const YAML::Node& node) {
  if (!node || node.IsNull()) return "nothing";
  if (node.IsScalar()) return std::string(1, '\'').append(node.Scalar(), 0, 60).append(1, '\'');
  return node.IsMap() ? "a mapping" : "a list";
}

}  // namespace

std::string yaml_fault(const std::string& where, const YAML::Exception& fault, const std::string& what) {
  return where + ":" + std::to_string(fault.mark.line + 1) + ": " + (what.empty() ? "" : what + ": ") + fault.msg;
}

std::string YamlProblems::place(const YAML::Node& node) const {
  return where_ + ":" + std::to_string(node ? node.Mark().line + 1 : table_line_);
}

void YamlProblems::problem(const YAML::Node& at, const std::string& what, const std::string& expected,
                           const std::string& found) {
  problems.push_back(describe_mismatch(place(at), what, expected, found));
}

void YamlProblems::problem(const YAML::Node& at, const std::string& what, const std::string& expected) {
  problem(at, what, expected, content_of(at));
}

void YamlProblems::refuse_unknown(const YAML::Node& table, const std::set<std::string>& known) {
  table_line_ = table.Mark().line + 1;
  for (const auto& entry : table)
    if (!entry.first.IsScalar() || !known.contains(entry.first.Scalar()))
      problem(entry.first, "key", "one of " + listed(known));
  refuse_repeated(table);
}

void YamlProblems::refuse_repeated(const YAML::Node& table) {
  std::set<std::string> seen;
  for (const auto& entry : table)
    if (entry.first.IsScalar() && !seen.insert(entry.first.Scalar()).second)
      problem(entry.first, "key", "each once", "'" + entry.first.Scalar() + "' again");
}

}  // namespace felt
