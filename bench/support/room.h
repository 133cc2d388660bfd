#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "mapping/map.h"

namespace felt::bench {

/// Signed distance of a room of 5 x 4 x 2.6 m, seen from inside, with a ball and a box in it, metres.
inline double room_distance(const Eigen::Vector3d& p) {
  const double walls = (Eigen::Vector3d(2.5, 2.0, 1.3) - p.cwiseAbs()).minCoeff();
  const double ball = (p - Eigen::Vector3d(0.4, 0.3, -0.2)).norm() - 0.6;
  const Eigen::Vector3d q = (p - Eigen::Vector3d(-1.5, -1.2, -0.9)).cwiseAbs() - Eigen::Vector3d(0.6, 0.4, 0.4);
  return std::min({walls, ball, q.cwiseMax(0).norm() + std::min(q.maxCoeff(), 0.0)});
}

/// The room as a coloured map: 2 cm voxels, 8 cm truncation, observed up to the truncation behind the surface.
inline Map room_map() {
  Map map(0.02, 0.08);
  for (int bx = -17; bx <= 16; ++bx)
    for (int by = -14; by <= 13; ++by)
      for (int bz = -10; bz <= 9; ++bz) {
        const Eigen::Vector3d centre = (Eigen::Vector3d(bx, by, bz) * 8 + Eigen::Vector3d::Constant(3.5)) * 0.02;
        if (std::abs(room_distance(centre)) > 0.08 + 0.16 * 0.87) continue;
        Block& block = map.store[map.store.find_or_create({bx, by, bz})];
        ColorPlanes& color = map.store.add_color(block);
        for (int i = 0; i < kBlockVoxels; ++i) {
          const Index3 v = voxel_of_offset(i);
          const double d = room_distance(Eigen::Vector3d(bx * 8 + v.x, by * 8 + v.y, bz * 8 + v.z) * 0.02);
          block.geometry->weight[i] = d > -0.08 ? 1.0f : 0.0f;
          block.geometry->tsdf[i] = float(std::min(d, 0.08));
          color.r[i] = 200 * 256;
          color.count[i] = 1;
        }
      }
  return map;
}

}  // namespace felt::bench
