#pragma once

#include <Eigen/Core>
#include <functional>

#include "mapping/map.h"

namespace felt::test {

/// Writes a signed distance (metres, of a world point) into every voxel low <= index <= high with weight 1, cut to the
/// map's truncation.
void fill_map(Map& map, const Index3& low, const Index3& high,
              const std::function<double(const Eigen::Vector3d&)>& distance_m);

/// One voxel.
void set_voxel(Map& map, const Index3& voxel, float tsdf_m, float weight = 1);

}  // namespace felt::test
