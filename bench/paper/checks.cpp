#include "bench/paper/checks.h"

#include <cmath>

namespace felt::paper {

void Checks::within(const std::string& what, double value, double error, double expected, double last_digit) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", expected);
  claims_.push_back({what, text, value, error, std::abs(value - expected) <= 3 * error + 0.5 * last_digit});
}

void Checks::not_worse(const std::string& what, double difference, double error) {
  claims_.push_back({what, "not below 0", difference, error, difference >= -3 * error});
}

void Checks::better(const std::string& what, double difference, double error) {
  claims_.push_back({what, "above 0", difference, error, difference > 3 * error});
}

bool Checks::report() const {
  bool good = true;
  std::printf("\n| claim | expected | seen | standard error | |\n|---|---|---|---|---|\n");
  for (const Claim& c : claims_) {
    std::printf("| %s | %s | %.4f | %.4f | %s |\n", c.what.c_str(), c.expected.c_str(), c.value, c.error,
                c.good ? "holds" : "**fails**");
    good = good && c.good;
  }
  return good;
}

}  // namespace felt::paper
