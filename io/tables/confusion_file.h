#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "core/class_table.h"
#include "core/confusion_matrix.h"

namespace felt {

/// Reads how often each true class was labelled as each class, over the classes of a table, k * k numbers by slot, one
/// row a true class. CSV: a header line with a free first cell and then the names of the predicted classes, and a line
/// for each true class, its name first. YAML (.yaml, .yml): `classes: [names]` and `counts: [[row of the first true
/// class], ...]`. Counts, or shares. Classes come in any order, as `name` or `id_name`; those that the table ignores
/// are passed over, every other one of the table must have its row and column. Throws IoError, or ConfigError with
/// the first problem (path:line), and how many more.
std::vector<double> read_confusion_counts(const std::filesystem::path& file, const ClassTable& classes);
/// The same from CSV text; `where` stands for the path in messages.
std::vector<double> parse_confusion_counts(const std::string& text, const ClassTable& classes,
                                           const std::string& where);

/// The same with each row divided by its sum. A class that was never seen has no row: ConfigError.
ConfusionMatrix read_confusion_matrix(const std::filesystem::path& file, const ClassTable& classes);
ConfusionMatrix parse_confusion_matrix(const std::string& text, const ClassTable& classes, const std::string& where);

/// CSV that `parse_confusion_matrix` turns back into an equal matrix, up to the last bit of each number.
std::string confusion_csv(const ConfusionMatrix& confusion, const ClassTable& classes);

/// CSV or YAML of counts that `read_confusion_counts` reads back; `comment`: lines put first, after '#', in YAML.
std::string confusion_counts_csv(std::span<const double> counts, const ClassTable& classes);
std::string confusion_counts_yaml(std::span<const double> counts, const ClassTable& classes,
                                  const std::string& comment);

}  // namespace felt
