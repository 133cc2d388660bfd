#pragma once

#include <set>

#include "mapping/store/region.h"

namespace felt::test {

/// World indices of a region's voxels.
inline std::set<Index3> voxels_of(const Region& region) {
  std::set<Index3> voxels;
  for (size_t b = 0; b < region.blocks(); ++b)
    for_each_bit(region.mask[b], [&](int i) {
      const Index3 f = first_voxel(region.coord[b]), v = voxel_of_offset(i);
      voxels.insert({f.x + v.x, f.y + v.y, f.z + v.z});
    });
  return voxels;
}

}  // namespace felt::test
