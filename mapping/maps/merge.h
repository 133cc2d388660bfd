#pragma once

#include <limits>
#include <span>
#include <string>

#include "mapping/map.h"

namespace felt {

struct MergeOptions {
  /// Frames that two journals share would count twice: refused unless this is set.
  bool allow_shared_frames = false;
  /// Cap of the summed weight, as in integration (IntegrationConfig::max_weight).
  float max_weight = 255.0f;
  /// Cap of a voxel's class evidence, likewise (LabelConfig::max_evidence); 0: none.
  float max_evidence = 0.0f;
};

/// One map of what several maps of the same world frame observed: distances averaged by weight, colours by number of
/// observations, weights and evidence added, journals of frames and touches joined. Equal to fusing all frames into one
/// map: exactly where counts are added, within rounding where averages are, as long as no weight and no evidence
/// reached its cap, nothing was carved, no evidence depends on earlier viewpoints, and all were fused with one weight
/// and distance; instances keep the id with most of the parts' leads. The result does not depend on the order of the
/// arguments. A property table may continue another: the result has the longest. Throws ConfigError naming every reason
/// why the maps do not go together: voxel size, truncation, class table, property table, shared frames.
Map merge(std::span<const Map* const> maps, const MergeOptions& options = {});

/// Key of a map's text as the single map had it: "config" of "config 2", which merging numbered.
std::string without_number(const std::string& key);

}  // namespace felt
