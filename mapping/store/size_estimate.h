#pragma once

#include <unordered_set>

#include "core/block.h"
#include "core/frame.h"

namespace felt {

/// Settings that decide how large a map grows.
struct MapResolution {
  double voxel_size_m = 0;
  double truncation_m = 0;
  bool color = true;
};

/// Surface seen so far, as coarse cells: gathered from a few frames of a sequence to foresee the size of its map.
class SurfaceEstimate {
public:
  explicit SurfaceEstimate(double cell_m) : cell_m_(cell_m) {}
  /// Marks the cells of every 4th pixel with min_depth_m <= depth <= max_depth_m.
  void add(const Frame& frame, double min_depth_m, double max_depth_m);
  double area_m2() const;

private:
  double cell_m_;
  std::unordered_set<Index3> cells_;
};

/// Blocks within the truncation of a surface of this area.
double blocks_near_surface(double area_m2, const MapResolution& resolution);

/// Largest surface that one frame is expected to show: facing the camera at `max_depth_m`, with as much again hidden in
/// slanted and broken surfaces.
double largest_area_in_view_m2(const PinholeCamera& camera, double max_depth_m);

/// Working memory of a command that fuses, meshes and saves this many blocks, bytes: planes, block records, mesh and
/// the grid that is being written.
double estimated_bytes(double blocks, const MapResolution& resolution);

}  // namespace felt
