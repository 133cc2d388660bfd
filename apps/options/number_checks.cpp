#include "apps/options/number_checks.h"

#include <charconv>
#include <cmath>
#include <optional>
#include <string>

#include "io/files/text_input.h"

namespace felt::apps {
namespace {

template <typename Good>
CLI::Validator number_check(const std::string& expected, const std::string& shown_in_help, Good good) {
  return {[expected, good](std::string& text) {
            const std::optional<double> value = parse_number(text);
            if (value && std::isfinite(*value) && good(*value)) return std::string();
            return "expected " + expected + ", found '" + text + "'";
          },
          shown_in_help};
}

}  // namespace

CLI::Validator above_zero() {
  return number_check("a finite number above 0", "ABOVE 0", [](double value) { return value > 0; });
}

CLI::Validator at_least_zero() {
  return number_check("a finite number from 0", "FROM 0", [](double value) { return value >= 0; });
}

CLI::Validator at_least_one() {
  return number_check("a finite number from 1", "FROM 1", [](double value) { return value >= 1; });
}

CLI::Validator finite() {
  return number_check("a finite number", "", [](double) { return true; });
}

CLI::Validator within(double low, double high) {
  const std::string range = CLI::detail::to_string(low) + " to " + CLI::detail::to_string(high);
  return number_check("a number from " + range, range, [=](double value) { return value >= low && value <= high; });
}

CLI::Validator above_zero_up_to(double high) {
  const std::string range = "ABOVE 0 to " + CLI::detail::to_string(high);
  return number_check("a number above 0, up to " + CLI::detail::to_string(high), range,
                      [=](double value) { return value > 0 && value <= high; });
}

CLI::Validator from_zero_to_below(double high) {
  const std::string range = "0 to below " + CLI::detail::to_string(high);
  return number_check("a number from " + range, range, [=](double value) { return value >= 0 && value < high; });
}

double short_decimal(float value) {
  char text[32];
  const auto [end, fault] = std::to_chars(text, text + sizeof text, value);
  return fault == std::errc() ? parse_number({text, size_t(end - text)}).value_or(double(value)) : double(value);
}

}  // namespace felt::apps
