#pragma once

#include <set>
#include <span>
#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt::apps {

// What the frame journal says of the settings that frames were fused with (`fusion_settings`).

/// Every number that runs have under this key.
std::set<double> numbers_of_runs(std::span<const Map> maps, const std::string& key);

/// What runs were fused with that makes what they measured unlike: "weight: constant and inverse-square". Settings that
/// a recording may need for itself (camera, numbering of its labels, ...) are compared within a recording only. Not
/// said: what `merge` refuses or has a rule for (voxels, classes, caps), and what only decides whether something is
/// kept at all (colours, instances).
std::vector<std::string> different_settings(std::span<const Map> maps);

/// Whether a run was made with this flag.
bool any_run_with(std::span<const Map> maps, const std::string& flag);

/// Least observation weight of an observed voxel, where nothing else is asked for: one frame's, if each frame weighs 1;
/// any weight, if weights depend on depth.
double least_observed_weight(const Map& map);

}  // namespace felt::apps
