#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <limits>

#include "core/image.h"
#include "mapping/map.h"
#include "mapping/store/block_index.h"

namespace felt {

inline int32_t floor_int(double x) {
  const auto i = int32_t(x);
  return i - (x < double(i));
}
inline Index3 floor_index(const Eigen::Vector3d& p) { return {floor_int(p.x()), floor_int(p.y()), floor_int(p.z())}; }

/// Trilinear value between the corners of a cell, numbered dx << 2 | dy << 1 | dz, at a point of it (0 to 1 each).
template <typename T>
T trilinear(const T (&d)[8], T x, T y, T z) {
  const T d00 = d[0] + z * (d[1] - d[0]), d01 = d[2] + z * (d[3] - d[2]);
  const T d10 = d[4] + z * (d[5] - d[4]), d11 = d[6] + z * (d[7] - d[6]);
  const T d0 = d00 + y * (d01 - d00), d1 = d10 + y * (d11 - d10);
  return d0 + x * (d1 - d0);
}

/// Reads a map at real voxel coordinates through its BlockIndex, remembering the group of blocks it last looked at and
/// the blocks around the cells that it read. One a task.
class MapSampler {
public:
  MapSampler(const Map& map, const BlockIndex& index, float min_weight)
      : index_(index), store_(map.store), min_weight_(min_weight), per_voxel_(float(1 / map.voxel_size_m)) {}

  const BlockIndex::Group* group(const Index3& coord) {
    if (!known_ || coord != group_coord_) {
      group_ = index_.group(coord);
      group_coord_ = coord;
      known_ = true;
    }
    return group_;
  }
  uint32_t find(const BlockCoord& block) {
    const BlockIndex::Group* g = group(block_of_voxel(block));
    return g == nullptr ? BlockIndex::kNone : g->block[size_t(offset_in_block(block))];
  }

  /// Signed distances of a cell's corners in voxels; false where one was not observed.
  bool distances(const Index3& base, float (&d)[8]);
  /// The same of a cell that the index has in a mask: its corners are known to be observed.
  void crossed_distances(const Index3& base, float (&d)[8]);
  /// Trilinear signed distance in voxels, NaN where one of the eight voxels was not observed.
  float distance(const Eigen::Vector3d& p);
  /// Unit gradient of the trilinear distance, zero where there is none: from the four corners of a tetrahedron around
  /// the point; at the limit of what was observed from differences along the axes, one-sided where need be.
  Eigen::Vector3f normal(const Eigen::Vector3d& p);
  /// Colour between the voxels around a point that have one; a = 0 where none has.
  Rgba8 color(const Eigen::Vector3d& p);
  VoxelRef nearest(const Eigen::Vector3d& p);
  /// The nearest of the eight voxels around a point that knows of a class, by vision or touch; the nearest where none
  /// does: one frame's noise can leave the nearest out of the band that takes labels.
  VoxelRef nearest_labelled(const Eigen::Vector3d& p);

  const BlockIndex& index() const { return index_; }

private:
  /// The blocks that the cells of one block reach into.
  struct Neighbourhood {
    bool known = false;
    BlockCoord coord;                               ///< of the block of the cells' first corners
    std::array<uint32_t, 8> block;                  ///< that block moved by (c >> 2, c >> 1 & 1, c & 1), or kNone
    std::array<const GeometryPlanes*, 8> geometry;  ///< theirs, or null
  };
  /// The eight voxels around a cell.
  struct Corners {
    std::array<uint8_t, 8> block;    ///< in the neighbourhood
    std::array<uint16_t, 8> offset;  ///< in that block
  };
  static Corners corners(const Index3& base);
  const Neighbourhood& around(const BlockCoord& block) {
    Neighbourhood& n = seen_[size_t((block.x & 1) << 2 | (block.y & 1) << 1 | (block.z & 1))];
    if (!n.known || n.coord != block) look_around(block, n);
    return n;
  }
  void look_around(const BlockCoord& block, Neighbourhood& n);

  const BlockIndex& index_;
  const BlockStore& store_;
  float min_weight_, per_voxel_;
  const BlockIndex::Group* group_ = nullptr;
  Index3 group_coord_;
  bool known_ = false;
  std::array<Neighbourhood, 8> seen_;  ///< by parity of the coordinates: those around a place do not meet
};

}  // namespace felt
