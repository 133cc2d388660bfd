#include "mapping/maps/table_difference.h"

#include <algorithm>

namespace felt {
namespace {

/// What distinguishes two properties of one name; empty for equal ones.
std::string difference_of(const Property& a, const Property& b) {
  if (a.unit != b.unit) return "another unit";
  if (a.support_lo != b.support_lo || a.support_hi != b.support_hi) return "another support";
  if (a.rho != b.rho) return "another rho";
  if (a.max_prior_readings != b.max_prior_readings) return "another limit of prior readings";
  return a.priors != b.priors ? "other priors" : "";
}

/// "only one has 'ice'" where one list goes on behind the end of the other.
template <typename Row>
std::string only_in_longer(const std::vector<Row>& a, const std::vector<Row>& b) {
  if (a.size() == b.size()) return "";
  return "only one has '" + (a.size() > b.size() ? a[b.size()] : b[a.size()]).name + "'";
}

}  // namespace

std::string first_difference(const ClassTable& a, const ClassTable& b) {
  const std::vector<ClassInfo>&rows_a = a.classes(), &rows_b = b.classes();
  const size_t both = std::min(rows_a.size(), rows_b.size());
  const auto text = [](const ClassInfo& row) { return "'" + row.name + "' (id " + std::to_string(row.id) + ")"; };
  for (size_t i = 0; i < both; ++i) {
    if (rows_a[i].id != rows_b[i].id || rows_a[i].name != rows_b[i].name)
      return "row " + std::to_string(i + 1) + " is " + text(rows_a[i]) + " and " + text(rows_b[i]);
    if (rows_a[i].ignore != rows_b[i].ignore) return text(rows_a[i]) + " is ignored in one only";
    if (!(rows_a[i].color == rows_b[i].color)) return text(rows_a[i]) + " has another color";
  }
  if (rows_a.size() != rows_b.size()) return only_in_longer(rows_a, rows_b);
  for (int slot = 0; slot < a.size(); ++slot)
    if (a.prior(slot) != b.prior(slot)) return text(a.at_slot(slot)) + " has another prior";
  return "";
}

std::string first_difference(const PropertyTable& a, const PropertyTable& b) {
  for (int i = 0; i < std::min(a.size(), b.size()); ++i) {
    if (a[i].name != b[i].name)
      return "property " + std::to_string(i + 1) + " is '" + a[i].name + "' and '" + b[i].name + "'";
    if (const std::string what = difference_of(a[i], b[i]); !what.empty()) return "'" + a[i].name + "' has " + what;
  }
  return only_in_longer(a.properties(), b.properties());
}

bool continues(const PropertyTable& longer, const PropertyTable& shorter) {
  return shorter.size() <= longer.size() &&
         std::equal(shorter.properties().begin(), shorter.properties().end(), longer.properties().begin());
}

}  // namespace felt
