#include "io/tables/class_table_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"
#include "io/files/yaml_text.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

constexpr size_t kLimitBytes = 1 << 24;

struct Table {
  std::vector<ClassInfo> classes;
  YamlProblems found;
};

bool means_no_class(const std::string& name) {
  constexpr std::array kNames = {"unknown", "unlabelled", "unlabeled", "none", "void", "background", "ignore"};
  return std::find(kNames.begin(), kNames.end(), name) != kNames.end();
}

std::optional<uint16_t> id_of(std::string_view word) {
  const auto number = parse_integer(word);
  return number && *number >= 0 && *number <= 0xffff ? std::optional<uint16_t>(uint16_t(*number)) : std::nullopt;
}

std::optional<Rgba8> color_of(const std::vector<std::string>& words) {
  std::array<uint8_t, 3> channel{};
  if (words.size() != 3) return std::nullopt;
  for (size_t i = 0; i < 3; ++i) {
    const auto number = parse_integer(words[i]);
    if (!number || *number < 0 || *number > 255) return std::nullopt;
    channel[i] = uint8_t(*number);
  }
  return Rgba8{channel[0], channel[1], channel[2], 255};
}

std::string scalar_text(const YAML::Node& node) { return node && node.IsScalar() ? node.Scalar() : std::string(); }

void read_yaml_class(const YAML::Node& row, Table& table) {
  if (!row.IsMap()) return table.found.problem(row, "class", "{id, name, color, ignore}", "something else");
  ClassInfo info;
  const int number = int(table.classes.size());
  const auto id = id_of(scalar_text(row["id"]));
  if (id)
    info.id = *id;
  else
    table.found.problem(row, "id", "a number from 0 to 65534", "'" + scalar_text(row["id"]) + "'");
  info.name = scalar_text(row["name"]);
  if (info.name.empty()) table.found.problem(row, "name", "a name", "none");
  info.color = default_class_color(number);
  if (row["color"]) {
    std::vector<std::string> words;
    if (row["color"].IsSequence())
      for (const YAML::Node& channel : row["color"]) words.push_back(scalar_text(channel));
    if (const auto color = color_of(words))
      info.color = *color;
    else
      table.found.problem(row, "color", "[r, g, b] from 0 to 255", "something else");
  }
  if (row["ignore"]) {
    bool ignore = false;
    if (YAML::convert<bool>::decode(row["ignore"], ignore))
      info.ignore = ignore;
    else
      table.found.problem(row, "ignore", "true or false", "'" + scalar_text(row["ignore"]) + "'");
  }
  if (row["prior"]) {
    const auto prior = parse_number(scalar_text(row["prior"]));
    if (prior && *prior > 0 && std::isfinite(*prior))
      info.prior = *prior;
    else
      table.found.problem(row, "prior", "a number above 0", "'" + scalar_text(row["prior"]) + "'");
  }
  table.found.refuse_unknown(row, {"id", "name", "color", "ignore", "prior"});
  // A class whose id is unreadable would also be reported as a duplicate of class 0.
  if (id && !info.name.empty()) table.classes.push_back(info);
}

Table read_yaml(const fs::path& path, const std::string& content) {
  Table table{{}, YamlProblems(path.string())};
  try {
    const YAML::Node root = YAML::Load(content);
    if (!root.IsMap() || !root["classes"] || !root["classes"].IsSequence())
      throw ConfigError(describe_mismatch(path.string(), "classes", "a list under the key 'classes'", "none"));
    table.found.refuse_repeated(root);  // keys that are not ours are left alone
    for (const YAML::Node& row : root["classes"]) read_yaml_class(row, table);
  } catch (const YAML::Exception& fault) {
    throw ConfigError(yaml_fault(path.string(), fault));
  }
  return table;
}

Table read_csv(const fs::path& path, const std::string& content) {
  Table table{{}, YamlProblems(path.string())};
  LineReader lines(content, path);
  bool first = true;
  char separator = ',';
  while (lines.next()) {
    if (first) separator = csv_separator(lines.line());
    const std::vector<std::string> words = csv_cells(lines.line(), separator);
    const auto id = id_of(words[0]);
    const bool header = first && !id;
    first = false;
    if (header) continue;
    if (!id || words.size() < 2 || words[1].empty()) {
      table.found.problems.push_back(describe_mismatch(lines.where(), "class",
                                                       "id" + std::string(1, separator) + "name",
                                                       "'" + std::string(lines.line().substr(0, 60)) + "'"));
      continue;
    }
    ClassInfo info{*id, words[1], default_class_color(int(table.classes.size())), *id == 0 && means_no_class(words[1])};
    // Further columns that are no numbers are something else.
    const auto is_number = [](const std::string& word) { return parse_number(word).has_value(); };
    if (words.size() >= 5 && std::all_of(words.begin() + 2, words.begin() + 5, is_number)) {
      if (const auto color = color_of({words[2], words[3], words[4]}))
        info.color = *color;
      else
        table.found.problems.push_back(describe_mismatch(lines.where(), "color", "r, g, b from 0 to 255",
                                                         "'" + words[2] + ", " + words[3] + ", " + words[4] + "'"));
    }
    table.classes.push_back(info);
  }
  return table;
}

}  // namespace

ClassTable read_class_table(const fs::path& path) {
  const std::string content = read_whole_file(path, kLimitBytes);
  require_utf8(content, path.string());
  Table table = path.extension() == ".csv" ? read_csv(path, content) : read_yaml(path, content);
  try {
    ClassTable classes(std::move(table.classes));
    if (table.found.problems.empty()) return classes;
  } catch (const ConfigError& fault) {
    table.found.problems.push_back(path.string() + ": " + fault.what());
  }
  throw ConfigError(table.found.problems);
}

std::string class_table_yaml(const ClassTable& classes) {
  std::ostringstream text;
  text << "classes:\n";
  for (const ClassInfo& c : classes.classes()) {
    text << "  - {id: " << c.id << ", name: " << yaml_scalar(c.name) << ", color: [" << int(c.color.r) << ", "
         << int(c.color.g) << ", " << int(c.color.b) << "]" << (c.ignore ? ", ignore: true" : "");
    if (c.prior) text << ", prior: " << nlohmann::json(*c.prior).dump();  // every digit: tables are compared
    text << "}\n";
  }
  return text.str();
}

}  // namespace felt
