#pragma once

#include <CLI/CLI.hpp>

namespace felt::apps {

/// Checks of an option's number. CLI11's own let NaN pass and print the largest double in full.
CLI::Validator above_zero();
CLI::Validator at_least_zero();
CLI::Validator finite();

}  // namespace felt::apps
