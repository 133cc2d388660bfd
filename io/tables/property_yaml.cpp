#include "io/tables/property_yaml.h"

#include <yaml-cpp/yaml.h>
#include <utility>
#include <vector>

#include <cmath>
#include <set>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"

namespace felt {
namespace {

class Walker : public YamlProblems {
public:
  using YamlProblems::YamlProblems;

  void number(const YAML::Node& node, const std::string& what, double& value) {
    double read;
    // "inf" is no number to YAML, which writes ".inf", and what everybody writes.
    const auto plain = node.IsScalar() ? parse_number(node.Scalar()) : std::nullopt;
    if (plain && !std::isnan(*plain))
      value = *plain;
    else if (node.IsScalar() && YAML::convert<double>::decode(node, read) && !std::isnan(read))
      value = read;
    else
      problem(node, what, "a number");
  }
  /// Calls `visit(key, value)` for each entry of a mapping; a key that comes twice is a problem.
  template <typename Visit>
  void mapping(const YAML::Node& node, const std::string& what, const Visit& visit) {
    if (!node.IsMap()) return problem(node, what, "a mapping");
    std::set<std::string> seen;
    for (const auto& entry : node) {
      if (!entry.first.IsScalar()) {
        problem(entry.first, what, "names as keys");
        continue;
      }
      const std::string key = entry.first.Scalar();
      if (seen.insert(key).second)
        visit(key, entry.first, entry.second);
      else
        problem(entry.first, what, "each key once", "'" + key + "' again");
    }
  }
};

PropertyPrior read_prior(Walker& walker, const YAML::Node& name, const YAML::Node& node, const std::string& what) {
  PropertyPrior prior;
  bool has_mean = false, has_sd = false;
  walker.mapping(node, what, [&](const std::string& key, const YAML::Node& key_node, const YAML::Node& value) {
    if (key == "mean")
      has_mean = true, walker.number(value, what + ".mean", prior.mean);
    else if (key == "sd")
      has_sd = true, walker.number(value, what + ".sd", prior.sd);
    else if (key == "readings")
      walker.number(value, what + ".readings", prior.readings);
    else
      walker.problem(key_node, what, "mean, sd or readings");
  });
  if (node.IsMap() && !(has_mean && has_sd)) walker.problem(name, what, "both mean and sd");
  return prior;
}

Property read_property(Walker& walker, const std::string& name, const YAML::Node& node) {
  Property p;
  p.name = name;
  walker.mapping(node, name, [&](const std::string& key, const YAML::Node& key_node, const YAML::Node& value) {
    const std::string what = name + "." + key;
    if (key == "unit") {
      if (value.IsScalar())
        p.unit = value.Scalar();
      else
        walker.problem(value, what, "a word");
    } else if (key == "support") {
      if (value.IsSequence() && value.size() == 2) {
        walker.number(value[0], what + "[0]", p.support_lo);
        walker.number(value[1], what + "[1]", p.support_hi);
      } else {
        walker.problem(value, what, "[lo, hi]");
      }
    } else if (key == "rho") {
      walker.number(value, what, p.rho);
    } else if (key == "max_prior_readings") {
      walker.number(value, what, p.max_prior_readings);
    } else if (key == "priors") {
      walker.mapping(value, what, [&](const std::string& class_name, const YAML::Node& at, const YAML::Node& prior) {
        p.priors[class_name] = read_prior(walker, at, prior, what + "." + class_name);
      });
    } else {
      walker.problem(key_node, name, "unit, support, rho, max_prior_readings or priors");
    }
  });
  return p;
}

}  // namespace

PropertyTable parse_properties(const std::string& text, const std::string& where) {
  require_utf8(text, where);
  YAML::Node document;
  try {
    document = YAML::Load(text);
  } catch (const YAML::Exception& e) {
    throw ConfigError(yaml_fault(where, e, "not YAML"));
  }
  Walker walker(where);
  std::vector<Property> properties;
  std::vector<std::string>& problems = walker.problems;
  walker.mapping(document, "properties", [&](const std::string& name, const YAML::Node& at, const YAML::Node& node) {
    const size_t before = problems.size();
    Property property = read_property(walker, name, node);
    // What the types allow and the values do not is said by the table itself; one table per property gives it a line.
    if (problems.size() == before) {
      try {
        PropertyTable{{property}};
      } catch (const ConfigError& e) {
        problems.push_back(walker.place(at) + ": " + e.what());
      }
    }
    properties.push_back(std::move(property));
  });
  if (!problems.empty()) throw ConfigError(problems);
  return PropertyTable(std::move(properties));
}

PropertyTable read_properties(const std::filesystem::path& file) {
  return parse_properties(read_file_or_pipe(file), file.string());
}

std::string properties_yaml(const PropertyTable& table) {
  YAML::Emitter out;
  out.SetDoublePrecision(17);
  out << YAML::BeginMap;
  for (const Property& p : table.properties()) {
    out << YAML::Key << p.name << YAML::Value << YAML::BeginMap;
    out << YAML::Key << "unit" << YAML::Value << YAML::DoubleQuoted << p.unit;
    out << YAML::Key << "support" << YAML::Value << YAML::Flow << YAML::BeginSeq << p.support_lo << p.support_hi
        << YAML::EndSeq;
    out << YAML::Key << "rho" << YAML::Value << p.rho;
    out << YAML::Key << "max_prior_readings" << YAML::Value << p.max_prior_readings;
    out << YAML::Key << "priors" << YAML::Value << YAML::BeginMap;
    for (const auto& [name, prior] : p.priors)
      out << YAML::Key << YAML::DoubleQuoted << name << YAML::Value << YAML::Flow << YAML::BeginMap << YAML::Key
          << "mean" << YAML::Value << prior.mean << YAML::Key << "sd" << YAML::Value << prior.sd << YAML::Key
          << "readings" << YAML::Value << prior.readings << YAML::EndMap;
    out << YAML::EndMap << YAML::EndMap;
  }
  out << YAML::EndMap;
  return std::string(out.c_str()) + "\n";
}

}  // namespace felt
