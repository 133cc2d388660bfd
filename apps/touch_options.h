#pragma once

#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/camera.h"
#include "mapping/regions/region_query.h"
#include "mapping/touch/touch_state.h"

namespace felt::apps {

/// Accepts "x,y,z" with three finite numbers; the check of options that take a point.
std::string check_point(const std::string& text);
Eigen::Vector3d point_of(const std::string& text);

/// Options that say which voxels a touch speaks for, shared by `touch` and `region`.
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
};

/// The strongest class, the class posterior and its entropy; empty in a map without classes.
nlohmann::ordered_json class_json(const Map& map, const Belief& belief);
/// `properties` of `belief_json`.
nlohmann::ordered_json properties_json(const Map& map, const Belief& belief, std::optional<double> below);

/// Class posterior and, per property, mean, sd, quantiles, CVaR, and with `below` P(psi <= below). What does not exist
/// is null with its reason.
nlohmann::ordered_json belief_json(const Map& map, const Belief& belief, std::optional<double> below);
nlohmann::ordered_json summary_json(const Map& map, const RegionSummary& summary);
nlohmann::ordered_json point_json(const Eigen::Vector3d& p);

/// A line for each property of `belief_json`: mean, sd, quantiles, CVaR, and what it decides.
std::string property_text(const nlohmann::ordered_json& belief);

/// One line a person can read: "ice 0.97, friction 0.171 +- 0.043".
std::string belief_text(const Map& map, const Belief& belief);

/// Warns of priors for a class that the table lacks and that differs from one of its classes in capitals only.
void warn_of_misspelt_priors(const PropertyTable& properties, const ClassTable& classes, const std::string& where);

/// Tables of the command line replace those of the map: properties as far as no touch needs what they lack.
void use_properties(Map& map, const std::string& file);

}  // namespace felt::apps
