#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "core/class_table.h"
#include "core/property_table.h"
#include "mapping/store/block_store.h"
#include "mapping/store/frame_journal.h"
#include "mapping/store/touch_journal.h"

namespace felt {

/// A map: plain data. Index (i, j, k) is the voxel centre at index * voxel_size_m, world frame, metres.
struct Map {
  Map(double voxel_size_m_, double truncation_m_)
      : voxel_size_m(voxel_size_m_), truncation_m(truncation_m_), store(float(truncation_m_)) {}

  double voxel_size_m;
  double truncation_m;
  BlockStore store;
  ClassTable classes;        ///< empty: a map without semantics
  PropertyTable properties;  ///< what touches can measure
  FrameJournal frames;
  TouchJournal touches;
  /// Text that travels with the map, by key: the configuration as used, where it came from. Not part of `map_hash`.
  std::map<std::string, std::string> metadata;
};

/// The voxel whose centre is nearest to a world point, observed or not; nothing where the point is no place of a map:
/// not finite, or beyond 1e9 voxels from the origin.
std::optional<Index3> nearest_voxel(const Map& map, const Eigen::Vector3d& point_m);

/// Signed distance at a world point, metres: trilinear between the eight voxel centres about it, of which those without
/// a share in it need not be observed; nothing where another one was not, or where the point is no place of a map.
std::optional<double> sample_tsdf(const Map& map, const Eigen::Vector3d& point_m);

/// Number of voxels with weight > 0.
size_t active_voxel_count(const Map& map);

/// Heap bytes of the classes' evidence: planes and what lists them.
size_t class_bytes(const Map& map);

/// Hash (XXH3, 128 bits, hex) of every stored value and its coordinate in canonical order: equal for equal maps,
/// whatever the number of threads, the order of block creation, or the layout of a file. Blocks that hold nothing do
/// not count.
std::string map_hash(const Map& map);

}  // namespace felt
