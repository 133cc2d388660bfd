#include "io/files/yaml_problems.h"

#include <yaml-cpp/yaml.h>

#include "core/error.h"

namespace felt {

void YamlProblems::problem(const YAML::Node& at, const std::string& what, const std::string& expected,
                           const std::string& found) {
  problems.push_back(
      describe_mismatch(file_.string() + ":" + std::to_string(at.Mark().line + 1), what, expected, found));
}

void YamlProblems::refuse_unknown(const YAML::Node& table, const std::set<std::string>& known) {
  std::string names;
  for (const std::string& name : known) names += (names.empty() ? "" : ", ") + name;
  for (const auto& entry : table)
    if (!entry.first.IsScalar() || !known.contains(entry.first.Scalar()))
      problem(entry.first, "key", "one of " + names,
              entry.first.IsScalar() ? "'" + entry.first.Scalar() + "'" : "a list");
}

}  // namespace felt
