#pragma once

#include <string>
#include <vector>

#include "mapping/regions/region_query.h"
#include "mapping/touch/touch_state.h"

namespace felt {

struct SuggestionSettings {
  int most = 10;            ///< suggestions returned
  size_t min_voxels = 200;  ///< smaller segments are not worth a touch
  RegionSettings region;    ///< rule `connected`, or `segment` for those of mapping/regions/map_segments.h
};

/// What a touch may find: the segment is class `slot` and reads as that class does on average.
struct Outcome {
  int slot = 0;
  double probability = 0;                 ///< of the class, before
  double reading = 0;                     ///< unit of the property
  std::vector<double> class_probability;  ///< after that reading, by slot
};

/// A segment and what one touch of it would teach.
struct Suggestion {
  Eigen::Vector3d point_m, normal;  ///< where to touch: the surface nearest to the segment's middle
  size_t voxels = 0;
  double area_m2 = 0;
  double gain_nat = 0;  ///< expected information about the class; segments are ranked by gain_nat * area_m2
  std::vector<double> class_probability;
  std::vector<Outcome> outcomes;  ///< classes of at least 5 %, most probable first, at most four
};

/// Cuts the map's labelled surface into the regions that touches would update, in canonical order of their first voxel;
/// each voxel belongs to the first region that reaches it. With the rule `segment` they are the map's segments,
/// labelled or not. Regions below `min_voxels` are left out.
std::vector<Region> segments(const Map& map, const RegionSettings& settings, size_t min_voxels);

/// Segments ranked by expected information gain of a reading of `property` times area. Throws TouchError for an unknown
/// property or one that no class of the map has a prior for.
std::vector<Suggestion> suggest_touches(const Map& map, const std::string& property,
                                        const SuggestionSettings& settings);

}  // namespace felt
