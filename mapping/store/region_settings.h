#pragma once

#include <limits>
#include <string>

#include "core/error.h"

namespace felt {

/// A touch or a query that the map cannot answer: free or unobserved space, an unlabelled contact, an unusable reading.
class TouchError : public Error {
public:
  using Error::Error;
};

enum class RegionRule { connected, mask, sphere, instance, segment };
const char* rule_name(RegionRule rule);
/// Throws TouchError for an unknown name.
RegionRule rule_of_name(const std::string& name);

/// Which voxels a touch speaks for. The *surface band* is every voxel with |tsdf| <= band and weight >= min_weight.
struct RegionSettings {
  RegionRule rule = RegionRule::connected;
  double band_voxels = 1;    ///< half width of the surface band
  double min_weight = 1;     ///< observation weight below which a voxel counts as unobserved
  double snap_voxels = 3;    ///< how far from the given point the surface may be
  double class_ratio = 0.5;  ///< `connected`: belief in the contact's class over that in the voxel's strongest class
  double normal_change_deg = 20;                                  ///< `connected`: between neighbouring voxels
  double color_change = std::numeric_limits<double>::infinity();  ///< `connected`: grey levels from the contact's
  double radius_m = std::numeric_limits<double>::infinity();      ///< `connected`: geodesic; `sphere`: Euclidean
  bool operator==(const RegionSettings&) const = default;
};

/// Throws TouchError naming every setting that is not a number in its range.
void validate(const RegionSettings& settings);

}  // namespace felt
