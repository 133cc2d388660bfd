#pragma once

#include <cstdio>
#include <string>
#include <vector>

namespace felt::paper {

/// Claims of the experiments, checked by the run that makes the tables.
class Checks {
public:
  /// `value` must be within three standard errors of `expected`, which is known to half a unit of its last digit.
  void within(const std::string& what, double value, double error, double expected, double last_digit = 0.001);
  /// `difference` must not be below zero by more than three standard errors.
  void not_worse(const std::string& what, double difference, double error);
  /// `difference` must be above zero by more than three standard errors.
  void better(const std::string& what, double difference, double error);

  /// Prints a table of all claims; false where one failed.
  bool report() const;

private:
  struct Claim {
    std::string what, expected;
    double value, error;
    bool good;
  };
  std::vector<Claim> claims_;
};

}  // namespace felt::paper
