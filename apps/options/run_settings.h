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

/// What runs were fused with that makes what they measured unlike: "weight: constant and inverse-square". How labels
/// and colours are to be read is compared within a recording only, and what concerns labels among maps that have any.
/// Not said: what `merge` refuses or has a rule for (voxels, classes, caps), how else a recording was read
/// (`RecordingAsRead`), and what only decides whether something is kept at all (colours, instances).
std::vector<std::string> different_settings(std::span<const Map> maps);

/// Whether any label reached the map.
bool has_evidence(const Map& map);

/// Whether a run was made with this flag.
bool any_run_with(std::span<const Map> maps, const std::string& flag);

/// Least observation weight of an observed voxel, where nothing else is asked for: one frame's, if each frame weighs 1;
/// any weight, if weights depend on depth.
double least_observed_weight(const Map& map);

}  // namespace felt::apps
