#include "core/property_table.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "core/utf8.h"

namespace felt {
namespace {

/// Letters, digits, '_', '-' and '.': names become parts of grid names.
bool valid_property_name(const std::string& name) {
  return !name.empty() && std::all_of(name.begin(), name.end(), [](unsigned char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
  });
}

}  // namespace

PropertyTable::PropertyTable(std::vector<Property> properties) : properties_(std::move(properties)) {
  std::vector<std::string> problems;
  std::set<std::string> names;
  const auto expect = [&](bool good, const std::string& where, const char* what, const char* expected,
                          const std::string& found) {
    if (!good) problems.push_back(describe_mismatch(where, what, expected, found));
  };
  for (const Property& p : properties_) {
    const std::string where = "property '" + p.name + "'";
    expect(valid_property_name(p.name), where, "name", "letters, digits, '_', '-' and '.'", "'" + p.name + "'");
    expect(is_utf8(p.unit), where, "unit", "UTF-8", "other bytes");
    expect(names.insert(p.name).second, where, "name", "unique names", "it twice");
    expect(p.support_lo < p.support_hi, where, "support", "lo < hi",
           number_text(p.support_lo) + " and " + number_text(p.support_hi));
    expect(p.rho >= 0 && p.rho < 1, where, "rho", "0 <= rho < 1", number_text(p.rho));
    expect(std::isfinite(p.max_prior_readings) && p.max_prior_readings >= 1e-6, where, "max_prior_readings",
           "a number of at least 1e-6", number_text(p.max_prior_readings));
    for (const auto& [class_name, prior] : p.priors) {
      const std::string row = where + ", class '" + class_name + "'";
      expect(is_utf8(class_name), where, "names of classes", "UTF-8", "other bytes");
      // Squares of all of them, and their products, must be numbers.
      constexpr double kLargest = 1e15, kFewestReadings = 1e-6;
      expect(prior.mean >= p.support_lo && prior.mean <= p.support_hi, row, "mean", "a number in the support",
             number_text(prior.mean));
      expect(std::abs(prior.mean) <= kLargest, row, "mean", "a number of size up to 1e15", number_text(prior.mean));
      expect(prior.sd >= 1 / kLargest && prior.sd <= kLargest, row, "sd", "a number from 1e-15 to 1e15",
             number_text(prior.sd));
      expect(std::isfinite(prior.readings) && prior.readings >= kFewestReadings, row, "readings",
             "a number of at least 1e-6", number_text(prior.readings));
    }
  }
  if (!problems.empty()) throw ConfigError(problems);
}

std::optional<int> PropertyTable::index_of(const std::string& name) const {
  for (int i = 0; i < size(); ++i)
    if (properties_[i].name == name) return i;
  return std::nullopt;
}

bool ClassPriors::any() const {
  return std::any_of(has_prior.begin(), has_prior.end(), [](uint8_t has) { return has != 0; });
}

ClassPriors class_priors(const Property& property, const ClassTable& classes) {
  const size_t k = size_t(classes.size());
  ClassPriors priors{std::vector<double>(k, 0.0), std::vector<double>(k, 1.0), std::vector<double>(k, 1.0),
                     std::vector<double>(k, 1.0), std::vector<uint8_t>(k, 0)};
  for (size_t slot = 0; slot < k; ++slot) {
    const auto found = property.priors.find(classes.at_slot(int(slot)).name);
    if (found == property.priors.end()) continue;
    const double nu = std::min(found->second.readings, property.max_prior_readings);
    priors.tau[slot] = found->second.mean;
    priors.kappa[slot] = nu;
    priors.beta[slot] = nu / 2;
    priors.gamma[slot] = nu / 2 * found->second.sd * found->second.sd;
    priors.has_prior[slot] = 1;
  }
  return priors;
}

}  // namespace felt
