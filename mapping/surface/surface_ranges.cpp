#include "mapping/surface/surface_ranges.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace felt {
namespace {
using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kSlack = 1e-3;  ///< voxels, and pixels: more than rounding can move a ray or a block

/// What of an image a block covers; pixels and voxels.
struct Footprint {
  double left, right, top, bottom, nearest, farthest;
};

/// Projects the cube of a block's cells. False where no pixel can see it.
bool project(const PinholeCamera& camera, const Matrix3d& R_camera_world, const Vector3d& low, double nearest,
             double farthest, Footprint& out) {
  constexpr double kSide = kBlockDim;
  const Vector3d centre = low + R_camera_world * Vector3d::Constant(kSide / 2);
  constexpr double kRadius = 0.8661 * kSide;  // half of its diagonal
  if (centre.z() + kRadius < nearest || centre.z() - kRadius > farthest) return false;
  const double inf = std::numeric_limits<double>::infinity();
  out = {inf, -inf, inf, -inf, inf, -inf};
  const double width = camera.width, height = camera.height;
  // How far the corner that is farthest in lies within each edge of the image, times its depth.
  double in_left = -inf, in_right = -inf, in_top = -inf, in_bottom = -inf;
  for (int c = 0; c < 8; ++c) {
    const Vector3d p =
        low + kSide * (double(c >> 2) * R_camera_world.col(0) + double(c >> 1 & 1) * R_camera_world.col(1) +
                       double(c & 1) * R_camera_world.col(2));
    const double z = p.z(), u = camera.fx * p.x() + camera.cx * z, v = camera.fy * p.y() + camera.cy * z;
    in_left = std::max(in_left, u + z), in_right = std::max(in_right, width * z - u);
    in_top = std::max(in_top, v + z), in_bottom = std::max(in_bottom, height * z - v);
    out.nearest = std::min(out.nearest, z), out.farthest = std::max(out.farthest, z);
    out.left = std::min(out.left, u / z), out.right = std::max(out.right, u / z);
    out.top = std::min(out.top, v / z), out.bottom = std::max(out.bottom, v / z);
  }
  if (out.farthest < nearest || out.nearest > farthest) return false;
  if (in_left < 0 || in_right < 0 || in_top < 0 || in_bottom < 0) return false;
  // Around the camera itself it can cover anything.
  if (!(out.nearest > kSlack)) out.left = out.top = 0, out.right = width, out.bottom = height;
  return true;
}

}  // namespace

SurfaceRanges::SurfaceRanges(const BlockIndex& index, double voxel_size_m, const PinholeCamera& camera,
                             const Eigen::Isometry3d& T_world_camera, const Range& limits)
    : columns_((camera.width + kTile - 1) / kTile) {
  const int rows = (camera.height + kTile - 1) / kTile;
  constexpr Range kNothing{std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity()};
  const std::vector<Range> empty(size_t(columns_) * size_t(rows), kNothing);
  const Matrix3d rotation = T_world_camera.linear().transpose();
  const Vector3d eye = T_world_camera.translation() / voxel_size_m;
  const double nearest = limits.nearest_m / voxel_size_m, farthest = limits.farthest_m / voxel_size_m;
  const auto blocks = index.crossed();
  // The range of a tile does not depend on the order of blocks: each task gathers for itself.
  tbb::enumerable_thread_specific<std::vector<Range>> gathered(empty);
  tbb::parallel_for(tbb::blocked_range<size_t>(0, blocks.size(), 512), [&](const auto& part) {
    std::vector<Range>& ranges = gathered.local();
    for (size_t i = part.begin(); i < part.end(); ++i) {
      const BlockCoord& b = blocks[i];
      const Vector3d low = rotation * (double(kBlockDim) * Vector3d(b.x, b.y, b.z) - eye);
      Footprint f;
      if (!project(camera, rotation, low, nearest, farthest, f)) continue;
      const auto tile_of = [](double pixel, int tiles) {
        return int(std::clamp(std::floor(pixel / kTile), 0.0, double(tiles - 1)));
      };
      const int u0 = tile_of(f.left - kSlack, columns_), u1 = tile_of(f.right + kSlack, columns_);
      const int v0 = tile_of(f.top - kSlack, rows), v1 = tile_of(f.bottom + kSlack, rows);
      for (int v = v0; v <= v1; ++v)
        for (int u = u0; u <= u1; ++u) {
          Range& range = ranges[size_t(v) * size_t(columns_) + size_t(u)];
          range.nearest_m = std::min(range.nearest_m, f.nearest);
          range.farthest_m = std::max(range.farthest_m, f.farthest);
        }
    }
  });
  ranges_ = empty;
  for (const std::vector<Range>& part : gathered)
    for (size_t i = 0; i < ranges_.size(); ++i) {
      ranges_[i].nearest_m = std::min(ranges_[i].nearest_m, part[i].nearest_m);
      ranges_[i].farthest_m = std::max(ranges_[i].farthest_m, part[i].farthest_m);
    }
  for (Range& range : ranges_) {
    range.nearest_m = std::max((range.nearest_m - kSlack) * voxel_size_m, limits.nearest_m);
    range.farthest_m = std::min((range.farthest_m + kSlack) * voxel_size_m, limits.farthest_m);
  }
}

}  // namespace felt
