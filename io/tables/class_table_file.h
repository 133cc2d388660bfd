#pragma once

#include <filesystem>
#include <string>

#include "core/class_table.h"

namespace felt {

/// Reads a class table: `classes.yaml` (`classes: [{id, name, color: [r, g, b], ignore, prior}, ...]`) or a CSV with
/// one class a line, `id,name` or `id;name;r;g;b` (NYU40 list; a header line and further columns are passed over). In a
/// CSV, where nothing can be marked, id 0 is ignored when its name says that it is no class (unknown, unlabelled, none,
/// void, background, ignore). Classes without a colour get one. Throws IoError, or ConfigError with every problem found
/// (path:line).
ClassTable read_class_table(const std::filesystem::path& path);

/// The text of a `classes.yaml` that reads as this table.
std::string class_table_yaml(const ClassTable& classes);

}  // namespace felt
