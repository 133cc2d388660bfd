#include "io/tables/confusion_file.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"

namespace felt {
namespace {

constexpr const char* kExact = "%.17g";

std::string quoted(const std::string& text) { return std::string(1, '\'').append(text).append(1, '\''); }

/// The first few names, and how many more there are.
std::string list_of(const std::vector<std::string>& names) {
  constexpr size_t kNamed = 3;
  return listed(names, quoted, kNamed);
}

std::vector<std::string> split(const std::string& text, char separator) {
  std::vector<std::string> parts;
  size_t from = 0;
  for (size_t at = text.find(separator); at != std::string::npos; from = at + 1, at = text.find(separator, from))
    parts.push_back(text.substr(from, at - from));
  parts.push_back(text.substr(from));
  return parts;
}

/// Rows and columns by class, gathered cell by cell.
class Counts {
public:
  Counts(const ClassTable& classes, std::string where)
      : classes_(classes), where_(std::move(where)), has_row_(size_t(classes.size()), false) {
    for (const ClassInfo& c : classes.classes()) {
      by_name_[std::to_string(c.id) + "_" + c.name] = &c;
      by_name_[c.name] = &c;  // a class that is really called so
    }
    counts_.assign(size_t(classes.size()) * size_t(classes.size()), 0.0);
  }

  void columns(const std::vector<std::string>& names, const std::string& at) {
    for (const std::string& name : names) column_slot_.push_back(slot_of(name, at, "predicted class"));
    std::vector<std::string> missing;
    for (int slot = 0; slot < classes_.size(); ++slot) {
      const auto times = std::count(column_slot_.begin(), column_slot_.end(), slot);
      if (times == 0) missing.push_back(classes_.at_slot(slot).name);
      if (times > 1)
        problem(at, "column " + quoted(classes_.at_slot(slot).name), "it once",
                "it " + std::to_string(times) + " times");
    }
    if (!missing.empty()) problem(at, "columns", "every class", "none for " + list_of(missing));
  }

  void row(const std::string& name, const std::vector<std::string>& cells, const std::string& at) {
    const int truth = slot_of(name, at, "true class");
    if (cells.size() != column_slot_.size())
      return problem(at, "numbers", std::to_string(column_slot_.size()), std::to_string(cells.size()));
    if (truth >= 0 && has_row_[size_t(truth)]) problem(at, "true class", "each class once", quoted(name) + " again");
    if (truth >= 0) has_row_[size_t(truth)] = true;
    for (size_t c = 0; c < cells.size(); ++c) {
      const auto value = parse_number(cells[c]);
      if (!value || !std::isfinite(*value) || *value < 0)
        problem(at, "number " + std::to_string(c + 1), "a finite number >= 0", quoted(cells[c]));
      else if (truth >= 0 && column_slot_[c] >= 0)
        counts_[size_t(truth) * size_t(classes_.size()) + size_t(column_slot_[c])] = *value;
    }
  }

  void problem(const std::string& at, const std::string& what, const std::string& expected, const std::string& found) {
    problems_.push_back(describe_mismatch(at, what, expected, found));
  }

  std::vector<double> take() {
    std::vector<std::string> missing;
    for (int slot = 0; slot < classes_.size(); ++slot)
      if (!has_row_[size_t(slot)]) missing.push_back(classes_.at_slot(slot).name);
    if (!missing.empty()) problem(where_, "rows", "every class", "none for " + list_of(missing));
    if (!problems_.empty()) throw ConfigError(first_of(problems_));
    return std::move(counts_);
  }

private:
  /// -1 for classes that the table ignores, and for those that it does not have.
  int slot_of(const std::string& name, const std::string& at, const char* what) {
    const auto found = by_name_.find(name);
    if (found == by_name_.end()) problem(at, what, "a class of the table", quoted(name));
    if (found == by_name_.end() || found->second->ignore) return -1;
    return classes_.slot_of_id(found->second->id);
  }

  const ClassTable& classes_;
  std::string where_;
  std::map<std::string, const ClassInfo*> by_name_;
  std::vector<int> column_slot_;
  std::vector<bool> has_row_;
  std::vector<double> counts_;
  std::vector<std::string> problems_;
};

std::vector<std::string> scalars(const YAML::Node& list) {
  std::vector<std::string> texts;
  if (list.IsSequence())
    for (const YAML::Node& item : list) texts.push_back(item.IsScalar() ? item.Scalar() : "");
  return texts;
}

std::vector<double> parse_yaml_counts(const std::string& text, const ClassTable& classes, const std::string& where) {
  const auto at = [&](const YAML::Node& node) { return where + ":" + std::to_string(node.Mark().line + 1); };
  try {
    const YAML::Node root = YAML::Load(text);
    if (!root.IsMap() || !root["classes"].IsDefined() || !root["counts"].IsDefined() || !root["counts"].IsSequence())
      throw ConfigError(describe_mismatch(where, "confusion matrix", "'classes: [...]' and 'counts: [[...], ...]'",
                                          "something else"));
    Counts counts(classes, where);
    const std::vector<std::string> names = scalars(root["classes"]);
    counts.columns(names, at(root["classes"]));
    if (root["counts"].size() != names.size())
      counts.problem(at(root["counts"]), "rows", std::to_string(names.size()), std::to_string(root["counts"].size()));
    for (size_t i = 0; i < std::min(names.size(), root["counts"].size()); ++i)
      counts.row(names[i], scalars(root["counts"][i]), at(root["counts"][i]));
    return counts.take();
  } catch (const YAML::Exception& fault) {
    throw ConfigError(yaml_fault(where, fault));
  }
}

}  // namespace

std::vector<double> parse_confusion_counts(const std::string& text, const ClassTable& classes,
                                           const std::string& where) {
  Counts counts(classes, where);
  bool header = true;
  char separator = ',';
  for (LineReader lines(text, where); lines.next(false);) {
    if (header) separator = csv_separator(lines.line());
    const std::vector<std::string> cells = csv_cells(lines.line(), separator), values(cells.begin() + 1, cells.end());
    if (std::exchange(header, false))
      counts.columns(values, lines.where());
    else
      counts.row(cells[0], values, lines.where());
  }
  return counts.take();
}

std::vector<double> read_confusion_counts(const std::filesystem::path& file, const ClassTable& classes) {
  constexpr size_t kLargest = 64 << 20;  // 1000 classes with 17 digits each are 20 MB
  const std::string text = read_file_or_pipe(file, kLargest);
  const bool yaml = file.extension() == ".yaml" || file.extension() == ".yml";
  return yaml ? parse_yaml_counts(text, classes, file.string()) : parse_confusion_counts(text, classes, file.string());
}

ConfusionMatrix read_confusion_matrix(const std::filesystem::path& file, const ClassTable& classes) {
  return confusion_matrix(read_confusion_counts(file, classes), classes.size(), file.string());
}

ConfusionMatrix parse_confusion_matrix(const std::string& text, const ClassTable& classes, const std::string& where) {
  return confusion_matrix(parse_confusion_counts(text, classes, where), classes.size(), where);
}

std::string confusion_csv(const ConfusionMatrix& confusion, const ClassTable& classes) {
  return confusion_counts_csv(confusion.p, classes);
}

std::string confusion_counts_csv(std::span<const double> counts, const ClassTable& classes) {
  const int k = classes.size();
  std::string text = "true\\predicted";
  for (int j = 0; j < k; ++j) text += "," + csv_cell(classes.at_slot(j).name);
  text += "\n";
  for (int i = 0; i < k; ++i) {
    text += csv_cell(classes.at_slot(i).name);
    for (int j = 0; j < k; ++j)
      text.append(1, ',').append(number_text(counts[size_t(i) * size_t(k) + size_t(j)], kExact));
    text += "\n";
  }
  return text;
}

std::string confusion_counts_yaml(std::span<const double> counts, const ClassTable& classes,
                                  const std::string& comment) {
  const int k = classes.size();
  std::string text;
  for (const std::string& line : split(comment, '\n')) text += "# " + line + "\n";
  text += "classes: [";
  for (int j = 0; j < k; ++j) text += (j ? ", " : "") + YAML::Dump(YAML::Node(classes.at_slot(j).name));
  text += "]\ncounts:  # one row a true class, one column a predicted one, pixels\n";
  for (int i = 0; i < k; ++i) {
    text += "  - [";
    for (int j = 0; j < k; ++j)
      text += (j ? ", " : "") + number_text(counts[size_t(i) * size_t(k) + size_t(j)], kExact);
    text += "]\n";
  }
  return text;
}

}  // namespace felt
