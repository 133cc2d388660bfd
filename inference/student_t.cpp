#include "inference/student_t.h"

#include <cmath>
#include <numbers>

#include "inference/special_functions.h"

namespace felt {

double log_pdf(const StudentT& t, double x) {
  const double half = t.dof / 2;
  const double spread2 = t.dof * t.scale2;
  const double d = x - t.location;
  return log_gamma_difference(half, 0.5) - 0.5 * std::log(std::numbers::pi * spread2) -
         (half + 0.5) * std::log1p(d * (d / spread2));
}

double pdf(const StudentT& t, double x) { return std::exp(log_pdf(t, x)); }

}  // namespace felt
