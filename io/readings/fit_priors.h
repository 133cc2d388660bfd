#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/property_table.h"
#include "inference/prior_fit.h"

namespace felt {

/// Readings of one class as a file lists them.
struct ClassReadings {
  std::string name;
  GroupedReadings groups;
};

/// Reads a CSV with a header that names the columns `class`, `value` and, where readings are grouped, `group` (in any
/// order; further columns are ignored; lines that start with # too). Classes and groups in order of appearance. Throws
/// IoError, or FormatError with path:line for a row that cannot be used.
std::vector<ClassReadings> read_readings_csv(const std::filesystem::path& file);

/// The fit as a property of a `properties.yaml` (io/tables/property_yaml.h), whose name, unit, support and largest
/// number of readings are given: mean and sd of every class that can be fitted, its effective readings, and the
/// classes' common rho (0.5 where groups do not tell it). Throws ConfigError where no class can be fitted, a reading
/// lies outside the support, or the name is none.
PropertyTable fitted_properties(const std::vector<ClassReadings>& classes, Property property);

/// The fit as one JSON document: `classes` (mean, sd, nu_0, rho, goodness of fit), `rho`, `confusion` (square table)
/// and `inseparable` (pairs that one touch does not separate). A class that cannot be fitted carries `error`.
std::string fit_priors_json(const std::vector<ClassReadings>& classes, double max_nu_0);

}  // namespace felt
