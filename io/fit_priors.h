#pragma once

#include <filesystem>
#include <string>
#include <vector>

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

/// The fit as one JSON document: `classes` (mean, sd, nu_0, rho, goodness of fit), `rho`, `confusion` (square table)
/// and `inseparable` (pairs that one touch does not separate). A class that cannot be fitted carries `error`.
std::string fit_priors_json(const std::vector<ClassReadings>& classes, double max_nu_0);

}  // namespace felt
