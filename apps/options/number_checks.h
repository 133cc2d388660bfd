#pragma once

#include <CLI/CLI.hpp>

namespace felt::apps {

/// Checks of an option's number. CLI11's own let NaN pass and print the largest double in full.
CLI::Validator above_zero();
CLI::Validator at_least_zero();
CLI::Validator at_least_one();
CLI::Validator finite();
CLI::Validator within(double low, double high);  ///< both ends allowed
CLI::Validator above_zero_up_to(double high);    ///< not 0, `high` allowed
CLI::Validator from_zero_to_below(double high);  ///< 0 allowed, not `high`

/// The double that a person would write for a float, 0.1 and not 0.10000000149: the shortest one that is that float.
double short_decimal(float value);

}  // namespace felt::apps
