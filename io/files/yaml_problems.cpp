#include "io/files/yaml_problems.h"

#include <yaml-cpp/yaml.h>

#include "core/error.h"

namespace felt {
namespace {

std::string content_of(const YAML::Node& node) {
  if (!node || node.IsNull()) return "nothing";
  if (node.IsScalar()) return std::string(1, '\'').append(node.Scalar(), 0, 60).append(1, '\'');
  return node.IsMap() ? "a mapping" : "a list";
}

}  // namespace

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
  std::string names;
  for (const std::string& name : known) names += (names.empty() ? "" : ", ") + name;
  std::set<std::string> seen;
  for (const auto& entry : table) {
    const YAML::Node& key = entry.first;
    if (!key.IsScalar() || !known.contains(key.Scalar()))
      problem(key, "key", "one of " + names);
    else if (!seen.insert(key.Scalar()).second)
      problem(key, "key", "each once", "'" + key.Scalar() + "' again");
  }
}

}  // namespace felt
