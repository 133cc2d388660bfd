#include "io/doctor/finding.h"

#include <cmath>

#include "core/text.h"

namespace felt {

std::string percent_text(double share) {
  return number_text(100 * share, std::abs(100 * share) < 10 ? "%.2g" : "%.0f") + " %";
}

std::string frames_text(const std::vector<int64_t>& numbers) {
  return listed(
      numbers, [](int64_t number) { return std::to_string(number); }, 6);
}

std::string intrinsics_option(double fx, double fy, double cx, double cy) {
  std::string option = "--intrinsics ";
  for (const double number : {fx, fy, cx, cy}) option += number_text(number, "%.5g") + ",";
  option.pop_back();
  return option;
}

}  // namespace felt
