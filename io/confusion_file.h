#pragma once

#include <filesystem>
#include <string>

#include "core/class_table.h"
#include "core/confusion_matrix.h"

namespace felt {

/// Reads a confusion matrix over the classes of a table from CSV: a header line with a free first cell and then the
/// names of the predicted classes, and a line for each true class, its name first. Counts or shares; rows are divided
/// by their sums. Rows and columns may come in any order, and every class of the table that is not ignored must have
/// both. Throws IoError, or ConfigError with every problem found (path:line).
ConfusionMatrix read_confusion_matrix(const std::filesystem::path& file, const ClassTable& classes);
/// The same from text; `where` stands for the path in messages.
ConfusionMatrix parse_confusion_matrix(const std::string& text, const ClassTable& classes, const std::string& where);

/// CSV that `parse_confusion_matrix` turns back into an equal matrix, up to the last bit of each number.
std::string confusion_csv(const ConfusionMatrix& confusion, const ClassTable& classes);

}  // namespace felt
