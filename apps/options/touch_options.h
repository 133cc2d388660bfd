#pragma once

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "mapping/regions/region_query.h"

namespace felt::apps {

/// Accepts "x,y,z" with three finite numbers; the check of options that take a point.
std::string check_point(const std::string& text);
/// The same, not all of them 0.
std::string check_direction(const std::string& text);
Eigen::Vector3d point_of(const std::string& text);

/// Options that say which voxels a touch speaks for, shared by `touch`, `region` and `export`.
struct RegionOptions {
  RegionSettings settings;            ///< its `min_weight` counts where the option was given
  CLI::Option* min_weight = nullptr;  ///< where it was not, the map's own weights decide
  std::string rule = "connected";
  std::string mask;                ///< picture of the rule `mask`
  std::vector<double> intrinsics;  ///< fx, fy, cx, cy
  std::vector<double> pose;        ///< 16 numbers, camera to world, row by row

  /// Adds the options, and returns them.
  std::vector<CLI::Option*> add_to(CLI::App& command);
  RegionSettings resolved(const Map& map) const;
  /// The mask with its camera where the rule is `mask`.
  std::optional<ViewMask> view() const;
  /// The region about a contact, within the mask where the rule is `mask`. `of_map`: what `resolved` gave for the map.
  Region region_at(const Map& map, const Contact& contact, const RegionSettings& of_map) const;
};

/// Warns of priors for a class that the table lacks and that differs from one of its classes in capitals only.
void warn_of_misspelt_priors(const PropertyTable& properties, const ClassTable& classes, const std::string& where);

/// Tables of the command line replace those of the map: properties as far as no touch needs what they lack.
void use_properties(Map& map, const std::string& file);

}  // namespace felt::apps
