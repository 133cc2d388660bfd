#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/camera.h"
#include "mapping/store/block_index.h"

namespace felt {

/// Where along a view's optical axis the surface of a map can be, tile by tile of the image: from the blocks that the
/// surface crosses, projected into it. Rays begin and end there instead of walking through empty space.
class SurfaceRanges {
public:
  static constexpr int kTile = 8;  ///< pixels on a side

  /// Depths along the optical axis, metres. Nothing can be seen where nearest > farthest.
  struct Range {
    double nearest_m, farthest_m;
  };

  /// Parallel; `limits` cuts every range.
  SurfaceRanges(const BlockIndex& index, double voxel_size_m, const PinholeCamera& camera,
                const Eigen::Isometry3d& T_world_camera, const Range& limits);

  /// Of the tile that holds a pixel.
  const Range& at(int u, int v) const { return ranges_[size_t(v / kTile) * size_t(columns_) + size_t(u / kTile)]; }

private:
  int columns_;
  std::vector<Range> ranges_;
};

}  // namespace felt
