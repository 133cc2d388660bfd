#pragma once

#include <Eigen/Geometry>
#include <limits>
#include <optional>

#include "core/camera.h"
#include "core/image.h"
#include "mapping/map.h"
#include "mapping/store/block_index.h"

namespace felt {

struct ViewOptions {
  double min_depth_m = 0.05;  ///< along the optical axis
  double max_depth_m = 10;
  bool normals = true;
  bool color = true;
};

/// What a camera would see of a map. Every image has the camera's size.
struct RenderedView {
  DepthImage depth_m;             ///< along the optical axis, 0 where the ray met nothing
  Image<Eigen::Vector3f> normal;  ///< unit, world frame; zero where there is none. Empty unless asked for
  ColorImage color;               ///< a = 0 where there is none. Empty unless asked for
  Image<VoxelRef> voxel;          ///< nearest to the surface point; of those around it that know of a class, if any
};

/// Ray casting through the blocks of a map, which must outlive the caster and not change meanwhile.
///
/// A ray walks from block to block and, in blocks that the surface crosses, from cell to cell (a cube between eight
/// voxel centres; mapping/store/block_index.h knows which the surface can cross). It stops in the first cell where the
/// trilinear signed distance, known at all eight corners, passes from positive to negative along the ray: the surface
/// that `extract_mesh` gives, seen from its front. The crossing is refined by regula falsi (Illinois) until the step is
/// below 1/1000 voxel.
class RayCaster {
public:
  explicit RayCaster(const Map& map, float min_weight = 1e-6f);

  /// Parallel over tiles; the same for any number of threads.
  RenderedView render(const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                      const ViewOptions& options = {}) const;

  /// First front-facing surface point along origin + s * direction (world, metres), s in (s_min, s_max): s, or nothing.
  std::optional<double> cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction, double s_min,
                             double s_max) const;

private:
  const Map& map_;
  float min_weight_;
  BlockIndex index_;
};

}  // namespace felt
