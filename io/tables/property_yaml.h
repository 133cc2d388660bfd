#pragma once

#include <filesystem>
#include <string>

#include "core/property_table.h"

namespace felt {

/// Reads `properties.yaml`: a mapping from property name to {unit, support: [lo, hi], rho, max_prior_readings, priors:
/// {class: {mean, sd, readings}}}. Throws IoError where the file cannot be read and ConfigError with every problem at
/// once, each with path:line.
PropertyTable read_properties(const std::filesystem::path& file);

/// The same from text; `where` stands for the path in messages.
PropertyTable parse_properties(const std::string& text, const std::string& where);

/// YAML that `parse_properties` turns back into an equal table.
std::string properties_yaml(const PropertyTable& table);

}  // namespace felt
