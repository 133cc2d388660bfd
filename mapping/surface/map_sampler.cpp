#include "mapping/surface/map_sampler.h"

#include <algorithm>

namespace felt {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kNothing = std::numeric_limits<float>::quiet_NaN();

bool knows_class(const Block& block, int offset) {
  for (const EvidencePlane& e : block.evidence)
    if (e.counts->value[offset] > 0) return true;
  for (const TouchPlanes& t : block.touch)
    if (t.n->value[offset] > 0) return true;
  return false;
}

}  // namespace

MapSampler::Corners MapSampler::corners(const Index3& base) {
  const int x = base.x & 7, y = base.y & 7, z = base.z & 7;
  // Axes along which the cell reaches into the next block.
  const int across = int(x == 7) << 2 | int(y == 7) << 1 | int(z == 7);
  Corners corners;
  for (int c = 0; c < 8; ++c) {
    corners.block[size_t(c)] = uint8_t(c & across);
    corners.offset[size_t(c)] = uint16_t(voxel_offset((x + (c >> 2)) & 7, (y + (c >> 1 & 1)) & 7, (z + (c & 1)) & 7));
  }
  return corners;
}

void MapSampler::look_around(const BlockCoord& block, Neighbourhood& n) {
  n.known = true;
  n.coord = block;
  for (int c = 0; c < 8; ++c) {
    const uint32_t found = find({block.x + (c >> 2), block.y + (c >> 1 & 1), block.z + (c & 1)});
    n.block[size_t(c)] = found;
    n.geometry[size_t(c)] = found == BlockIndex::kNone ? nullptr : store_[found].geometry;
  }
}

bool MapSampler::distances(const Index3& base, float (&d)[8]) {
  const Neighbourhood& n = around(block_of_voxel(base));
  bool observed = true;
  if ((base.x & 7) < 7 && (base.y & 7) < 7 && (base.z & 7) < 7) {
    // Two of three cells lie within one block.
    if (n.geometry[0] == nullptr) return false;
    const float* tsdf = n.geometry[0]->tsdf + offset_in_block(base);
    const float* weight = n.geometry[0]->weight + offset_in_block(base);
    for (int c = 0; c < 8; ++c) {
      const int v = voxel_offset(c >> 2, c >> 1 & 1, c & 1);
      observed &= weight[v] >= min_weight_;
      d[c] = tsdf[v] * per_voxel_;
    }
    return observed;
  }
  const Corners corner = corners(base);
  for (size_t c = 0; c < 8; ++c) {
    const GeometryPlanes* planes = n.geometry[corner.block[c]];
    if (planes == nullptr) return false;
    observed &= planes->weight[corner.offset[c]] >= min_weight_;
    d[c] = planes->tsdf[corner.offset[c]] * per_voxel_;
  }
  return observed;
}

void MapSampler::crossed_distances(const Index3& base, float (&d)[8]) {
  const Neighbourhood& n = around(block_of_voxel(base));
  if ((base.x & 7) < 7 && (base.y & 7) < 7 && (base.z & 7) < 7) {
    const float* tsdf = n.geometry[0]->tsdf + offset_in_block(base);
    for (int c = 0; c < 8; ++c) d[c] = tsdf[voxel_offset(c >> 2, c >> 1 & 1, c & 1)] * per_voxel_;
    return;
  }
  const Corners corner = corners(base);
  for (size_t c = 0; c < 8; ++c) d[c] = n.geometry[corner.block[c]]->tsdf[corner.offset[c]] * per_voxel_;
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
  const Neighbourhood& n = around(block_of_voxel(base));
  const Corners corner = corners(base);
  const float x = float(p.x() - base.x), y = float(p.y() - base.y), z = float(p.z() - base.z);
  float r = 0, g = 0, b = 0, total = 0;
  for (int c = 0; c < 8; ++c) {
    const uint32_t block = n.block[corner.block[size_t(c)]];
    if (block == BlockIndex::kNone) return {0, 0, 0, 0};
    const ColorPlanes* planes = store_[block].color;
    const int v = corner.offset[size_t(c)];
    if (planes == nullptr || planes->count[v] == 0) continue;
    const float w = (c >> 2 ? x : 1 - x) * (c >> 1 & 1 ? y : 1 - y) * (c & 1 ? z : 1 - z);
    r += w * planes->r[v], g += w * planes->g[v], b += w * planes->b[v];
    total += w;
  }
  if (!(total > 0)) return {0, 0, 0, 0};
  const float scale = 1 / (256 * total);
  const auto grey = [scale](float sum) { return uint8_t(std::min(sum * scale + 0.5f, 255.0f)); };
  return {grey(r), grey(g), grey(b), 255};
}

VoxelRef MapSampler::nearest(const Vector3d& p) {
  const Index3 v = floor_index(p + Vector3d::Constant(0.5));
  return {find(block_of_voxel(v)), uint16_t(offset_in_block(v))};
}

VoxelRef MapSampler::nearest_labelled(const Vector3d& p) {
  const VoxelRef nearest_one = nearest(p);
  if (nearest_one.block != BlockIndex::kNone && knows_class(store_[nearest_one.block], nearest_one.offset))
    return nearest_one;
  const Index3 base = floor_index(p);
  const Neighbourhood& n = around(block_of_voxel(base));
  const Corners corner = corners(base);
  VoxelRef best = nearest_one;
  double least = std::numeric_limits<double>::infinity();
  for (size_t c = 0; c < 8; ++c) {
    const uint32_t block = n.block[corner.block[c]];
    if (block == BlockIndex::kNone || !knows_class(store_[block], corner.offset[c])) continue;
    const Vector3d at(base.x + int(c >> 2), base.y + int(c >> 1 & 1), base.z + int(c & 1));
    const double distance = (p - at).squaredNorm();
    if (distance < least) least = distance, best = {block, corner.offset[c]};
  }
  return best;
}

}  // namespace felt
