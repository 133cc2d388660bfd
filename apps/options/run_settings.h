#pragma once

#include <set>
#include <span>
#include <string>

#include "mapping/map.h"

namespace felt::apps {

// What the frame journal says of the settings that frames were fused with (`fusion_settings`).

/// Every number that runs have under this key.
std::set<double> numbers_of_runs(std::span<const Map> maps, const std::string& key);

/// Every value that runs have under this key, as JSON text.
std::set<std::string> values_of_runs(std::span<const Map> maps, const std::string& key);

/// Whether a run was made with this flag.
bool any_run_with(std::span<const Map> maps, const std::string& flag);

/// Least observation weight of an observed voxel, where nothing else is asked for: one frame's, if each frame weighs 1;
/// any weight, if weights depend on depth.
double least_observed_weight(const Map& map);

}  // namespace felt::apps
