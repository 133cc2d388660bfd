#include "mapping/render.h"

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace felt {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

int32_t floor_int(double x) {
  const auto i = int32_t(x);
  return i - (x < double(i));
}

Index3 floor_index(const Vector3d& p) { return {floor_int(p.x()), floor_int(p.y()), floor_int(p.z())}; }

}  // namespace

/// Reads the map at real voxel coordinates, remembering the cell of blocks it last looked at.
class RayCaster::Sampler {
public:
  explicit Sampler(const RayCaster& caster)
      : index_(caster.index_),
        store_(caster.map_.store),
        min_weight_(caster.min_weight_),
        per_voxel_(float(1 / caster.map_.voxel_size_m)) {}

  /// The cell of blocks around a block.
  const BlockIndex::Cell* cell(const BlockCoord& block) {
    const Index3 coord = block_of_voxel(block);
    if (!known_ || coord != cell_coord_) {
      cell_ = index_.cell(block);
      cell_coord_ = coord;
      known_ = true;
    }
    return cell_;
  }
  uint32_t find(const BlockCoord& block) {
    const BlockIndex::Cell* c = cell(block);
    return c == nullptr ? BlockIndex::kNone : (*c)[size_t(offset_in_block(block))];
  }

  /// The eight voxels around a point: corner dx << 2 | dy << 1 | dz. False where one is in no block.
  struct Corners {
    std::array<VoxelRef, 8> voxel;
    std::array<float, 3> fraction;
  };
  bool corners(const Vector3d& p, Corners& out) {
    const Index3 base = floor_index(p);
    out.fraction = {float(p.x() - base.x), float(p.y() - base.y), float(p.z() - base.z)};
    const BlockCoord low = block_of_voxel(base);
    const int offset = offset_in_block(base);
    const bool inside = (base.x & 7) < 7 && (base.y & 7) < 7 && (base.z & 7) < 7;
    const uint32_t here = find(low);
    if (inside) {
      if (here == BlockIndex::kNone) return false;
      for (int c = 0; c < 8; ++c) out.voxel[c] = {here, uint16_t(offset + voxel_offset(c >> 2, c >> 1 & 1, c & 1))};
      return true;
    }
    for (int c = 0; c < 8; ++c) {
      const Index3 v{base.x + (c >> 2), base.y + (c >> 1 & 1), base.z + (c & 1)};
      const BlockCoord b = block_of_voxel(v);
      const uint32_t block = b == low ? here : find(b);
      if (block == BlockIndex::kNone) return false;
      out.voxel[c] = {block, uint16_t(offset_in_block(v))};
    }
    return true;
  }

  /// Trilinear signed distance in voxels, NaN where one of the eight voxels was not observed.
  double distance(const Vector3d& p) {
    float d[8];
    const Index3 base = floor_index(p);
    const float fx = float(p.x() - base.x), fy = float(p.y() - base.y), fz = float(p.z() - base.z);
    if ((base.x & 7) < 7 && (base.y & 7) < 7 && (base.z & 7) < 7) {
      // Two of three cells lie within one block.
      const uint32_t block = find(block_of_voxel(base));
      if (block == BlockIndex::kNone) return kNothing;
      const int offset = offset_in_block(base);
      const float* tsdf = store_[block].geometry->tsdf + offset;
      const float* weight = store_[block].geometry->weight + offset;
      bool observed = true;
      for (int c = 0; c < 8; ++c) {
        const int v = voxel_offset(c >> 2, c >> 1 & 1, c & 1);
        observed &= weight[v] >= min_weight_;
        d[c] = tsdf[v];
      }
      if (!observed) return kNothing;
    } else {
      Corners c;
      if (!corners(p, c)) return kNothing;
      for (int i = 0; i < 8; ++i) {
        const GeometryPlanes& planes = *store_[c.voxel[i].block].geometry;
        if (planes.weight[c.voxel[i].offset] < min_weight_) return kNothing;
        d[i] = planes.tsdf[c.voxel[i].offset];
      }
    }
    const float d00 = d[0] + fz * (d[1] - d[0]), d01 = d[2] + fz * (d[3] - d[2]);
    const float d10 = d[4] + fz * (d[5] - d[4]), d11 = d[6] + fz * (d[7] - d[6]);
    const float d0 = d00 + fy * (d01 - d00), d1 = d10 + fy * (d11 - d10);
    return double((d0 + fx * (d1 - d0)) * per_voxel_);
  }

  /// Signed distance in voxels of one voxel, NaN where not observed.
  double stored(uint32_t block, int offset) const {
    const GeometryPlanes& planes = *store_[block].geometry;
    return planes.weight[offset] < min_weight_ ? kNothing : double(planes.tsdf[offset] * per_voxel_);
  }

  /// Unit gradient of the trilinear distance, zero where there is none: from the four corners of a tetrahedron around
  /// the point; at the limit of what was observed from differences along the axes, one-sided where need be.
  Vector3f normal(const Vector3d& p) {
    constexpr double kReach = 0.75;
    Vector3d gradient = Vector3d::Zero();
    for (const Vector3d& corner : {Vector3d(1, 1, 1), Vector3d(1, -1, -1), Vector3d(-1, 1, -1), Vector3d(-1, -1, 1)})
      gradient += corner * distance(p + kReach * corner);
    if (!gradient.allFinite()) {
      const double here = distance(p);
      for (int axis = 0; axis < 3; ++axis) {
        double high = distance(p + Vector3d::Unit(axis)), low = distance(p - Vector3d::Unit(axis)), span = 2;
        if (std::isnan(high)) high = here, span -= 1;
        if (std::isnan(low)) low = here, span -= 1;
        gradient[axis] = span > 0 ? (high - low) / span : 0;
      }
    }
    const double norm = gradient.norm();
    return norm > 1e-6 ? Vector3f((gradient / norm).cast<float>()) : Vector3f(Vector3f::Zero());
  }

  /// Colour between the voxels around a point that have one.
  Rgba8 color(const Vector3d& p) {
    Corners c;
    Vector3f sum = Vector3f::Zero();
    float total = 0;
    if (!corners(p, c)) return {0, 0, 0, 0};
    for (int i = 0; i < 8; ++i) {
      const ColorPlanes* planes = store_[c.voxel[i].block].color;
      const int v = c.voxel[i].offset;
      if (planes == nullptr || planes->count[v] == 0) continue;
      const float w = (i >> 2 ? c.fraction[0] : 1 - c.fraction[0]) * (i >> 1 & 1 ? c.fraction[1] : 1 - c.fraction[1]) *
                      (i & 1 ? c.fraction[2] : 1 - c.fraction[2]);
      sum += w * Vector3f(planes->r[v], planes->g[v], planes->b[v]);
      total += w;
    }
    if (!(total > 0)) return {0, 0, 0, 0};
    sum = (sum / (256 * total) + Vector3f::Constant(0.5f)).cwiseMin(255.0f);
    return {uint8_t(sum.x()), uint8_t(sum.y()), uint8_t(sum.z()), 255};
  }

  VoxelRef nearest(const Vector3d& p) {
    const Index3 v = floor_index(p + Vector3d::Constant(0.5));
    return {find(block_of_voxel(v)), uint16_t(offset_in_block(v))};
  }

  const BlockIndex& index() const { return index_; }

private:
  const BlockIndex& index_;
  const BlockStore& store_;
  float min_weight_, per_voxel_;
  const BlockIndex::Cell* cell_ = nullptr;
  Index3 cell_coord_;
  bool known_ = false;
};

namespace {

/// A ray in voxel coordinates, t in voxels.
struct Ray {
  Vector3d origin, direction, inverse;
  Vector3d at(double t) const { return origin + t * direction; }
  /// Where the ray leaves the cube of `side` voxels that holds q = p + 1/2 (voxel v covers q in [v, v + 1)).
  double leave(const Index3& cube, int side) const {
    const int32_t low[3] = {cube.x, cube.y, cube.z};
    double t = std::numeric_limits<double>::infinity();
    for (int i = 0; i < 3; ++i) {
      if (direction[i] == 0) continue;
      const double wall = (double(low[i]) + (direction[i] > 0)) * side - 0.5;
      t = std::min(t, (wall - origin[i]) * inverse[i]);
    }
    return t;
  }
};

/// Cuts [t, t_end] to the box of all blocks.
void clip(const Ray& ray, const BlockIndex& index, double& t, double& t_end) {
  const int32_t low[3] = {index.low().x, index.low().y, index.low().z};
  const int32_t high[3] = {index.high().x, index.high().y, index.high().z};
  for (int i = 0; i < 3; ++i) {
    const double from = double(low[i]) * kBlockDim - 0.5, to = (double(high[i]) + 1) * kBlockDim - 0.5;
    if (ray.direction[i] == 0) {
      if (ray.origin[i] < from || ray.origin[i] > to) t_end = t;
      continue;
    }
    const double a = (from - ray.origin[i]) * ray.inverse[i], b = (to - ray.origin[i]) * ray.inverse[i];
    t = std::max(t, std::min(a, b));
    t_end = std::min(t_end, std::max(a, b));
  }
}

constexpr double kBeyondWall = 1e-4;    ///< voxels past a wall, so that rounding cannot hold a ray in front of it
constexpr double kFinest = 1e-3;        ///< voxels: where the refinement stops
constexpr double kTrilinearFrom = 1.5;  ///< voxels of stored distance below which the trilinear one is taken

/// The zero between a point in front and one behind, by the Illinois variant of regula falsi (Dowell and Jarratt
/// 1971). Returns the last point where the distance is known.
template <typename Distance>
double refine(double t_front, double d_front, double t_behind, double d_behind, Distance distance) {
  int side = 0;
  for (int step = 0; step < 20 && t_behind - t_front > kFinest; ++step) {
    const double t = (t_front * d_behind - t_behind * d_front) / (d_behind - d_front);
    const double d = distance(t);
    if (std::isnan(d)) break;
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

/// First crossing from front to back for t in (t, t_end), or NaN.
template <typename Sampler>
double march(Sampler& sampler, const Ray& ray, double t, double t_end) {
  // Last point that lies in front (NaN: the last point was behind or not observed), and its trilinear distance (NaN:
  // not looked at yet).
  double t_front = kNothing, d_front = kNothing;
  const auto distance = [&](double at) { return sampler.distance(ray.at(at)); };
  clip(ray, sampler.index(), t, t_end);
  while (t < t_end) {
    const Index3 voxel = floor_index(ray.at(t) + Vector3d::Constant(0.5));
    const BlockCoord block = block_of_voxel(voxel);
    const auto* cell = sampler.cell(block);
    if (cell == nullptr) {
      t = std::max(t, ray.leave(block_of_voxel(block), kBlockDim * kBlockDim)) + kBeyondWall;
      t_front = kNothing;
      continue;
    }
    const uint32_t number = (*cell)[size_t(offset_in_block(block))];
    if (number == BlockIndex::kNone || !sampler.index().near_surface(number)) {
      t = std::max(t, ray.leave(block, kBlockDim)) + kBeyondWall;
      t_front = kNothing;
      continue;
    }
    const double stored = sampler.stored(number, offset_in_block(voxel));
    if (stored > kTrilinearFrom) {
      t_front = t, d_front = kNothing;
      t += 0.5 * stored;
      continue;
    }
    const double d = std::isnan(stored) ? stored : distance(t);
    if (d > 0) {
      t_front = t, d_front = d;
      t += std::clamp(0.5 * d, 0.1, 0.75);
      continue;
    }
    if (d <= 0 && !std::isnan(t_front)) {
      if (std::isnan(d_front)) d_front = distance(t_front);
      if (d_front > 0) return refine(t_front, d_front, t, d, distance);
    }
    t_front = kNothing;
    t += 0.5;
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
  Sampler sampler(*this);
  const Vector3d unit = direction / length;
  const double per_s = length / map_.voxel_size_m;
  const double t =
      march(sampler, Ray{origin / map_.voxel_size_m, unit, unit.cwiseInverse()}, s_min * per_s, s_max * per_s);
  return std::isnan(t) ? std::nullopt : std::optional(t / per_s);
}

RenderedView RayCaster::render(const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                               const RenderOptions& options) const {
  RenderedView view;
  view.depth_m = DepthImage(camera.width, camera.height, 0);
  view.voxel = Image<VoxelRef>(camera.width, camera.height);
  if (options.normals) view.normal = Image<Vector3f>(camera.width, camera.height, Vector3f::Zero());
  if (options.color) view.color = ColorImage(camera.width, camera.height, {0, 0, 0, 0});
  const Vector3d origin = T_world_camera.translation() / map_.voxel_size_m;
  const Eigen::Matrix3d rotation = T_world_camera.linear();
  constexpr int kTile = 16;
  tbb::parallel_for(tbb::blocked_range2d<int>(0, camera.height, kTile, 0, camera.width, kTile), [&](const auto& tile) {
    Sampler sampler(*this);
    for (int v = tile.rows().begin(); v < tile.rows().end(); ++v)
      for (int u = tile.cols().begin(); u < tile.cols().end(); ++u) {
        const Vector3d along = camera.ray(u, v);
        const double voxels_per_depth = along.norm() / map_.voxel_size_m;
        const Vector3d unit = rotation * along.normalized();
        const Ray ray{origin, unit, unit.cwiseInverse()};
        const double t =
            march(sampler, ray, options.min_depth_m * voxels_per_depth, options.max_depth_m * voxels_per_depth);
        if (std::isnan(t)) continue;
        const Vector3d p = ray.at(t);
        view.depth_m(u, v) = float(t / voxels_per_depth);
        view.voxel(u, v) = sampler.nearest(p);
        if (options.normals) view.normal(u, v) = sampler.normal(p);
        if (options.color) view.color(u, v) = sampler.color(p);
      }
  });
  return view;
}

}  // namespace felt
