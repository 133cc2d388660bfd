#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "mapping/regions/region_query.h"
#include "mapping/touch/touch_state.h"

namespace felt::apps {

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

}  // namespace felt::apps
