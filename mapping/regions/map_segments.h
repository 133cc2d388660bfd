#pragma once

#include <cstddef>
#include <vector>

#include "mapping/map.h"
#include "mapping/store/region.h"
#include "mapping/store/region_settings.h"

namespace felt {

/// When two neighbouring voxels of a map's surface belong to one thing.
struct MapSegmentSettings {
  double band_voxels = 1;              ///< surface: voxels with |tsdf| up to this
  double min_weight = 1;               ///< and at least this observation weight
  double normal_change_deg = 15;       ///< largest angle between their normals
  double plane_distance_voxels = 0.6;  ///< largest distance of one's surface point to the other's tangent plane
  double color_change = 0;             ///< largest distance of their colours, CIE Lab units; 0: colour does not matter
  bool classes = true;                 ///< voxels whose strongest classes differ are parted
  size_t min_voxels = 100;             ///< smaller pieces go to the segment around them
};

/// Those of the region rule `segment`: band, least weight and, where limited, colour of the rule's settings.
MapSegmentSettings map_segment_settings(const RegionSettings& settings);

/// Cuts the surface of a map into segments: 26-neighbours are joined (union-find) where normals, tangent planes, colour
/// and class agree, then pieces below `min_voxels` (voxels of creases among them) are given to the segments that they
/// touch, nearest first and those of the same class before others. Every voxel of the surface is in one segment, but
/// for small pieces that touch none. Canonical order of the first voxel; the same for any number of threads.
std::vector<Region> map_segments(const Map& map, const MapSegmentSettings& settings = {});

}  // namespace felt
