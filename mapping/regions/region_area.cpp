#include "mapping/regions/region_area.h"

#include <tbb/parallel_for.h>

#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace felt {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// Signed distances of the face neighbours of a voxel, behind and ahead along each axis; NaN where not observed.
std::array<std::array<double, 2>, 3> neighbours_of(const Map& map, const Block& block, int i, float min_weight) {
  const Index3 v = voxel_at(block.coord, i);
  std::array<std::array<double, 2>, 3> distance{};
  for (int axis = 0; axis < 3; ++axis)
    for (int side = 0; side < 2; ++side) {
      const int step = 2 * side - 1;
      const Index3 u{v.x + (axis == 0 ? step : 0), v.y + (axis == 1 ? step : 0), v.z + (axis == 2 ? step : 0)};
      const BlockCoord coord = block_of_voxel(u);
      const Block* near = coord == block.coord ? &block : map.store.get(coord);
      const int at = offset_in_block(u);
      const bool observed = near != nullptr && near->geometry->weight[at] >= min_weight;
      distance[size_t(axis)][size_t(side)] = observed ? double(near->geometry->tsdf[at]) : kUnknown;
    }
  return distance;
}

/// Faces of voxels that a voxel stands for: those edges to its neighbours that the surface crosses nearer to it.
double faces_of(const Map& map, const Block& block, int i, float min_weight) {
  const double here = double(block.geometry->tsdf[i]);
  const auto distance = neighbours_of(map, block, i, min_weight);
  std::array<double, 3> slope{}, crossed{};
  for (size_t axis = 0; axis < 3; ++axis) {
    const auto [behind, ahead] = distance[axis];
    const bool knows_behind = !std::isnan(behind), knows_ahead = !std::isnan(ahead);
    if (knows_behind && knows_ahead)
      slope[axis] = (ahead - behind) / 2;
    else if (knows_behind || knows_ahead)
      slope[axis] = knows_ahead ? ahead - here : here - behind;
    // Of two ends that are equally near, the first counts.
    if (knows_behind && (behind > 0) != (here > 0) && std::abs(here) < std::abs(behind)) ++crossed[axis];
    if (knows_ahead && (ahead > 0) != (here > 0) && std::abs(here) <= std::abs(ahead)) ++crossed[axis];
  }
  const double length = std::sqrt(slope[0] * slope[0] + slope[1] * slope[1] + slope[2] * slope[2]);
  if (!(length > 0)) return 0;
  return (std::abs(slope[0]) * crossed[0] + std::abs(slope[1]) * crossed[1] + std::abs(slope[2]) * crossed[2]) / length;
}

}  // namespace

double surface_area_m2(const Map& map, const Region& region, const RegionSettings& settings) {
  std::vector<double> faces(region.blocks(), 0);
  tbb::parallel_for(size_t(0), region.blocks(), [&](size_t b) {
    const Block& block = *map.store.get(region.coord[b]);
    for_each_bit(region.mask[b], [&](int i) { faces[b] += faces_of(map, block, i, float(settings.min_weight)); });
  });
  return std::accumulate(faces.begin(), faces.end(), 0.0) * map.voxel_size_m * map.voxel_size_m;
}

}  // namespace felt
