#pragma once

#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/class_table.h"

namespace felt {

/// What is known of a property within one class before anything was touched.
struct PropertyPrior {
  double mean = 0;       ///< unit of the property
  double sd = 0;         ///< spread of single readings within the class, > 0
  double readings = 50;  ///< how many readings stand behind mean and sd
  bool operator==(const PropertyPrior&) const = default;
};

/// A named scalar that a touch can measure, for example friction, stiffness, or the force that opens a door.
struct Property {
  std::string name;
  std::string unit = "1";
  double support_lo = -std::numeric_limits<double>::infinity();  ///< smallest reading that can be true
  double support_hi = std::numeric_limits<double>::infinity();   ///< largest reading that can be true
  /// Intra-class correlation in [0, 1): variance between regions of a class over the total; 0.5 where nothing is known.
  double rho = 0.5;
  /// No prior counts for more readings than this, so that a map can still learn from its own touches.
  double max_prior_readings = 50;
  std::map<std::string, PropertyPrior> priors;  ///< by class name; a class without one takes no part in touches
  bool operator==(const Property&) const = default;
};

/// The properties of a map, in the order of the file that named them.
class PropertyTable {
public:
  PropertyTable() = default;
  /// Throws ConfigError naming every problem: names, supports, priors outside the support, counts that are not
  /// positive.
  explicit PropertyTable(std::vector<Property> properties);

  const std::vector<Property>& properties() const { return properties_; }
  int size() const { return int(properties_.size()); }
  bool empty() const { return properties_.empty(); }
  const Property& operator[](int i) const { return properties_[i]; }
  std::optional<int> index_of(const std::string& name) const;
  bool operator==(const PropertyTable&) const = default;

private:
  std::vector<Property> properties_;
};

/// Calibrated Normal-Inverse-Gamma priors of a property by class slot (structure of arrays of length k): with nu_0 =
/// min(readings, max_prior_readings) pseudo-observations tau = mean, kappa = nu_0, beta = nu_0 / 2, gamma = beta sd^2.
/// Slots without a prior hold the NIG (0, 1, 1, 1) and `has_prior` 0.
struct ClassPriors {
  std::vector<double> tau, kappa, beta, gamma;
  std::vector<uint8_t> has_prior;
  int size() const { return int(tau.size()); }
  bool any() const;
};
ClassPriors class_priors(const Property& property, const ClassTable& classes);

}  // namespace felt
