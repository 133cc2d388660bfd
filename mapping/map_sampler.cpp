#include "mapping/map_sampler.h"

#include <algorithm>

namespace felt {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

}  // namespace

bool MapSampler::corners(const Index3& base, std::array<VoxelRef, 8>& out) {
  const int x = base.x & 7, y = base.y & 7, z = base.z & 7;
  // Axes along which the cell reaches into the next block: only those corners need blocks of their own.
  const int across = int(x == 7) << 2 | int(y == 7) << 1 | int(z == 7);
  const BlockCoord low = block_of_voxel(base);
  uint32_t block[8];
  for (int c = 0; c < 8; ++c) {
    const int moved = c & across;
    if (moved == c) block[c] = find({low.x + (c >> 2), low.y + (c >> 1 & 1), low.z + (c & 1)});
    if (block[moved] == BlockIndex::kNone) return false;
    out[size_t(c)] = {block[moved],
                      uint16_t(voxel_offset((x + (c >> 2)) & 7, (y + (c >> 1 & 1)) & 7, (z + (c & 1)) & 7))};
  }
  return true;
}

bool MapSampler::distances(const Index3& base, float (&d)[8]) {
  bool observed = true;
  if ((base.x & 7) < 7 && (base.y & 7) < 7 && (base.z & 7) < 7) {
    // Two of three cells lie within one block.
    const uint32_t block = find(block_of_voxel(base));
    if (block == BlockIndex::kNone) return false;
    const float* tsdf = store_[block].geometry->tsdf + offset_in_block(base);
    const float* weight = store_[block].geometry->weight + offset_in_block(base);
    for (int c = 0; c < 8; ++c) {
      const int v = voxel_offset(c >> 2, c >> 1 & 1, c & 1);
      observed &= weight[v] >= min_weight_;
      d[c] = tsdf[v] * per_voxel_;
    }
    return observed;
  }
  std::array<VoxelRef, 8> voxel;
  if (!corners(base, voxel)) return false;
  for (size_t c = 0; c < 8; ++c) {
    const GeometryPlanes& planes = *store_[voxel[c].block].geometry;
    observed &= planes.weight[voxel[c].offset] >= min_weight_;
    d[c] = planes.tsdf[voxel[c].offset] * per_voxel_;
  }
  return observed;
}

float MapSampler::distance(const Vector3d& p) {
  float d[8];
  const Index3 base = floor_index(p);
  if (!distances(base, d)) return kNothing;
  return trilinear(d, float(p.x() - base.x), float(p.y() - base.y), float(p.z() - base.z));
}

Vector3f MapSampler::normal(const Vector3d& p) {
  constexpr double kReach = 0.75;
  const float a = distance(p + kReach * Vector3d(1, 1, 1)), b = distance(p + kReach * Vector3d(1, -1, -1));
  const float c = distance(p + kReach * Vector3d(-1, 1, -1)), d = distance(p + kReach * Vector3d(-1, -1, 1));
  Vector3f gradient(a + b - c - d, a - b + c - d, a - b - c + d);
  if (!gradient.allFinite()) {
    const float here = distance(p);
    for (int axis = 0; axis < 3; ++axis) {
      float high = distance(p + Vector3d::Unit(axis)), low = distance(p - Vector3d::Unit(axis)), span = 2;
      if (std::isnan(high)) high = here, span -= 1;
      if (std::isnan(low)) low = here, span -= 1;
      gradient[axis] = span > 0 ? (high - low) / span : 0;
    }
  }
  const float norm = gradient.norm();
  return norm > 1e-6f ? Vector3f(gradient / norm) : Vector3f(Vector3f::Zero());
}

Rgba8 MapSampler::color(const Vector3d& p) {
  const Index3 base = floor_index(p);
  std::array<VoxelRef, 8> voxel;
  if (!corners(base, voxel)) return {0, 0, 0, 0};
  const float x = float(p.x() - base.x), y = float(p.y() - base.y), z = float(p.z() - base.z);
  Vector3f sum = Vector3f::Zero();
  float total = 0;
  for (int i = 0; i < 8; ++i) {
    const ColorPlanes* planes = store_[voxel[size_t(i)].block].color;
    const int v = voxel[size_t(i)].offset;
    if (planes == nullptr || planes->count[v] == 0) continue;
    const float w = (i >> 2 ? x : 1 - x) * (i >> 1 & 1 ? y : 1 - y) * (i & 1 ? z : 1 - z);
    sum += w * Vector3f(planes->r[v], planes->g[v], planes->b[v]);
    total += w;
  }
  if (!(total > 0)) return {0, 0, 0, 0};
  sum = (sum / (256 * total) + Vector3f::Constant(0.5f)).cwiseMin(255.0f);
  return {uint8_t(sum.x()), uint8_t(sum.y()), uint8_t(sum.z()), 255};
}

VoxelRef MapSampler::nearest(const Vector3d& p) {
  const Index3 v = floor_index(p + Vector3d::Constant(0.5));
  return {find(block_of_voxel(v)), uint16_t(offset_in_block(v))};
}

}  // namespace felt
