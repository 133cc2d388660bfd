#pragma once

#include <optional>
#include <span>
#include <vector>

namespace felt {

/// Student-t with location and squared scale in the units of the property (squared); scale2 > 0, dof > 0.
struct StudentT {
  double location = 0;
  double scale2 = 1;
  double dof = 1;
  bool operator==(const StudentT&) const = default;
};

double log_pdf(const StudentT& t, double x);
double pdf(const StudentT& t, double x);

}  // namespace felt
