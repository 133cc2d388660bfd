#include "tests/support/analytic_map.h"

#include <algorithm>

namespace felt::test {

void set_voxel(Map& map, const Index3& voxel, float tsdf_m, float weight) {
  GeometryPlanes& planes = *map.store[map.store.find_or_create(block_of_voxel(voxel))].geometry;
  planes.tsdf[offset_in_block(voxel)] = tsdf_m;
  planes.weight[offset_in_block(voxel)] = weight;
}

void fill_map(Map& map, const Index3& low, const Index3& high,
              const std::function<double(const Eigen::Vector3d&)>& distance_m) {
  for (int x = low.x; x <= high.x; ++x)
    for (int y = low.y; y <= high.y; ++y)
      for (int z = low.z; z <= high.z; ++z) {
        const double d = distance_m(Eigen::Vector3d(x, y, z) * map.voxel_size_m);
        set_voxel(map, {x, y, z}, float(std::clamp(d, -map.truncation_m, map.truncation_m)));
      }
}

}  // namespace felt::test
