#include "mapping/surface/render.h"

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mapping/surface/map_sampler.h"
#include "mapping/surface/surface_ranges.h"

namespace felt {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
constexpr double kBeyondWall = 1e-4;  ///< voxels past a wall, so that rounding cannot hold a ray in front of it
constexpr double kGraze = 1e-6;       ///< voxels of distance that count as zero at a cell's wall
constexpr double kFinest = 1e-3;      ///< voxels: where the refinement stops

/// A ray in voxel coordinates, t in voxels.
struct Ray {
  Vector3d origin, direction, inverse;
  std::array<int, 3> step;  ///< 1 or -1 along each axis

  Ray(const Vector3d& from, const Vector3d& unit) : origin(from), direction(unit), inverse(unit.cwiseInverse()) {
    for (int i = 0; i < 3; ++i) step[i] = unit[i] < 0 ? -1 : 1;
  }
  Vector3d at(double t) const { return origin + t * direction; }
  /// Where the ray leaves the slab [low, low + 1] * side of an axis: never, where it runs along it.
  double leave(int axis, int32_t low, int side) const {
    if (direction[axis] == 0) return std::numeric_limits<double>::infinity();
    return ((double(low) + (step[axis] > 0)) * side - origin[axis]) * inverse[axis];
  }
};

/// Walks a ray through cubes of `side` voxels, one wall at a time (Amanatides and Woo 1987).
struct GridWalk {
  std::array<int32_t, 3> cube;
  std::array<double, 3> next;  ///< t where the ray leaves the cube along each axis

  GridWalk(const Ray& ray, const std::array<int32_t, 3>& start, int side) : cube(start) {
    for (int i = 0; i < 3; ++i) next[i] = ray.leave(i, cube[i], side);
  }
  int first_axis() const {
    if (next[0] < next[1]) return next[0] < next[2] ? 0 : 2;
    return next[1] < next[2] ? 1 : 2;
  }
  void advance(const Ray& ray, int axis, int side) {
    cube[axis] += ray.step[axis];
    next[axis] += side * std::abs(ray.inverse[axis]);
  }
};

/// The zero between a point in front and one behind, by the Illinois variant of regula falsi (Dowell and Jarratt 1971).
template <typename Distance>
double refine(double t_front, double d_front, double t_behind, double d_behind, Distance distance) {
  int side = 0;
  for (int step = 0; step < 20 && t_behind - t_front > kFinest; ++step) {
    const double t = (t_front * d_behind - t_behind * d_front) / (d_behind - d_front);
    const double d = distance(t);
    if (std::abs(d) < kFinest) return t;
    if (d > 0) {
      t_front = t, d_front = d;
      if (side == 1) d_behind /= 2;
      side = 1;
    } else {
      t_behind = t, d_behind = d;
      if (side == -1) d_front /= 2;
      side = -1;
    }
  }
  return (t_front * d_behind - t_behind * d_front) / (d_behind - d_front);
}

/// Crossing from front to back within a crossed cell that the ray is in from t to t_end, or NaN.
double cross_cell(MapSampler& sampler, const Ray& ray, const Index3& base, double t, double t_end) {
  float corner[8];
  sampler.crossed_distances(base, corner);
  double d[8];
  std::copy(std::begin(corner), std::end(corner), d);
  const Vector3d origin = ray.origin - Vector3d(base.x, base.y, base.z);
  const auto distance = [&](double at) {
    const Vector3d p = origin + at * ray.direction;
    return trilinear(d, p.x(), p.y(), p.z());
  };
  // A surface that lies in the wall between two cells is zero for both up to rounding: it must not slip through.
  const double d_in = distance(t);
  if (!(d_in > -kGraze)) return kNothing;
  const double d_out = distance(t_end);
  if (d_out <= kGraze && d_out < d_in) {
    if (d_in <= 0) return t;
    return d_out > 0 ? t_end : refine(t, d_in, t_end, d_out, distance);
  }
  if (!(d_in > 0)) return kNothing;
  // The distance along the ray is a cubic: it can dip below zero inside.
  const double t_middle = 0.5 * (t + t_end), d_middle = distance(t_middle);
  return d_middle <= 0 ? refine(t, d_in, t_middle, d_middle, distance) : kNothing;
}

/// The same over the crossed cells of one block.
double cross_block(MapSampler& sampler, const Ray& ray, const std::array<int32_t, 3>& block, const BlockMask& mask,
                   double t, double t_end) {
  const Vector3d p = ray.at(t);
  const Index3 first{block[0] * kBlockDim, block[1] * kBlockDim, block[2] * kBlockDim};
  const Index3 start{std::clamp(floor_int(p.x()), first.x, first.x + 7),
                     std::clamp(floor_int(p.y()), first.y, first.y + 7),
                     std::clamp(floor_int(p.z()), first.z, first.z + 7)};
  GridWalk walk(ray, {start.x, start.y, start.z}, 1);
  const Vector3d pace = ray.inverse.cwiseAbs();
  constexpr int kStride[3] = {64, 8, 1};
  int offset = offset_in_block(start);
  std::array<int, 3> left;  // cells to go along each axis
  for (int i = 0; i < 3; ++i) left[i] = ray.step[i] > 0 ? 7 - (walk.cube[i] & 7) : walk.cube[i] & 7;
  while (true) {
    const int axis = walk.first_axis();
    const double out = std::min(walk.next[axis], t_end);
    if (mask.test(offset) && out > t) {
      const double met = cross_cell(sampler, ray, {walk.cube[0], walk.cube[1], walk.cube[2]}, t, out);
      if (!std::isnan(met)) return met;
    }
    if (left[axis]-- == 0 || !(out < t_end)) return kNothing;
    t = out;
    walk.cube[axis] += ray.step[axis];
    walk.next[axis] += pace[axis];
    offset += ray.step[axis] * kStride[axis];
  }
}

/// Cuts [t, t_end] to the box of all cells.
void clip(const Ray& ray, const BlockIndex& index, double& t, double& t_end) {
  const int32_t low[3] = {index.low().x, index.low().y, index.low().z};
  const int32_t high[3] = {index.high().x, index.high().y, index.high().z};
  for (int i = 0; i < 3; ++i) {
    const double from = double(low[i]) * kBlockDim, to = (double(high[i]) + 1) * kBlockDim;
    if (ray.direction[i] == 0) {
      if (!(ray.origin[i] >= from && ray.origin[i] < to)) t_end = t;
      continue;
    }
    const double a = (from - ray.origin[i]) * ray.inverse[i], b = (to - ray.origin[i]) * ray.inverse[i];
    t = std::max(t, std::min(a, b));
    t_end = std::min(t_end, std::max(a, b));
  }
}

/// First crossing from front to back for t in (t, t_end), or NaN.
double march(MapSampler& sampler, const Ray& ray, double t, double t_end) {
  const BlockIndex& index = sampler.index();
  const BlockCoord &low = index.low(), &high = index.high();
  clip(ray, index, t, t_end);
  while (t < t_end) {
    const Vector3d p = ray.at(t) / kBlockDim;
    GridWalk walk(ray,
                  {std::clamp(floor_int(p.x()), low.x, high.x), std::clamp(floor_int(p.y()), low.y, high.y),
                   std::clamp(floor_int(p.z()), low.z, high.z)},
                  kBlockDim);
    while (true) {
      const BlockCoord block{walk.cube[0], walk.cube[1], walk.cube[2]};
      const Index3 group_coord = block_of_voxel(block);
      const BlockIndex::Group* group = sampler.group(group_coord);
      if (group == nullptr) {
        constexpr int kGroupSide = kBlockDim * kBlockDim;
        const double out = std::min({ray.leave(0, group_coord.x, kGroupSide), ray.leave(1, group_coord.y, kGroupSide),
                                     ray.leave(2, group_coord.z, kGroupSide)});
        t = std::max(t, out) + kBeyondWall;
        break;
      }
      const int axis = walk.first_axis();
      const double out = std::min(walk.next[axis], t_end);
      const uint32_t crossing = group->crossing[size_t(offset_in_block(block))];
      if (crossing != BlockIndex::kNone) {
        const double met = cross_block(sampler, ray, walk.cube, index.mask(crossing), t, out);
        if (!std::isnan(met)) return met;
      }
      if (!(out < t_end)) return kNothing;
      t = std::max(t, out);
      walk.advance(ray, axis, kBlockDim);
    }
  }
  return kNothing;
}

}  // namespace

RayCaster::RayCaster(const Map& map, float min_weight)
    : map_(map), min_weight_(std::max(min_weight, std::numeric_limits<float>::min())), index_(map.store, min_weight_) {}

std::optional<double> RayCaster::cast(const Vector3d& origin, const Vector3d& direction, double s_min,
                                      double s_max) const {
  const double length = direction.norm();
  if (!origin.allFinite() || !std::isfinite(length) || length == 0) return std::nullopt;
  MapSampler sampler(map_, index_, min_weight_);
  const double per_s = length / map_.voxel_size_m;
  const double t = march(sampler, Ray(origin / map_.voxel_size_m, direction / length), s_min * per_s, s_max * per_s);
  return std::isnan(t) ? std::nullopt : std::optional(t / per_s);
}

RenderedView RayCaster::render(const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                               const ViewOptions& options) const {
  RenderedView view;
  view.depth_m = DepthImage(camera.width, camera.height, 0);
  view.voxel = Image<VoxelRef>(camera.width, camera.height);
  if (options.normals) view.normal = Image<Vector3f>(camera.width, camera.height, Vector3f::Zero());
  if (options.color) view.color = ColorImage(camera.width, camera.height, {0, 0, 0, 0});
  const Vector3d origin = T_world_camera.translation() / map_.voxel_size_m;
  const Eigen::Matrix3d rotation = T_world_camera.linear();
  const SurfaceRanges ranges(index_, map_.voxel_size_m, camera, T_world_camera,
                             {options.min_depth_m, options.max_depth_m});
  constexpr int kTile = 2 * SurfaceRanges::kTile;
  tbb::parallel_for(tbb::blocked_range2d<int>(0, camera.height, kTile, 0, camera.width, kTile), [&](const auto& tile) {
    MapSampler sampler(map_, index_, min_weight_);
    for (int v = tile.rows().begin(); v < tile.rows().end(); ++v)
      for (int u = tile.cols().begin(); u < tile.cols().end(); ++u) {
        const auto [nearest_m, farthest_m] = ranges.at(u, v);
        if (!(nearest_m < farthest_m)) continue;
        const Vector3d along = camera.ray(u, v);
        const double length = along.norm(), voxels_per_depth = length / map_.voxel_size_m;
        const Ray ray(origin, rotation * (along / length));
        const double t = march(sampler, ray, nearest_m * voxels_per_depth, farthest_m * voxels_per_depth);
        if (std::isnan(t)) continue;
        const Vector3d p = ray.at(t);
        view.depth_m(u, v) = float(t / voxels_per_depth);
        view.voxel(u, v) = map_.classes.empty() ? sampler.nearest(p) : sampler.nearest_labelled(p);
        if (options.normals) view.normal(u, v) = sampler.normal(p);
        if (options.color) view.color(u, v) = sampler.color(p);
      }
  });
  return view;
}

}  // namespace felt
