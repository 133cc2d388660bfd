#include "mapping/region_surface.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace felt {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
/// The block with two voxels around it; z rows padded so that the block's own rows start at 4 and rows are aligned.
constexpr int kHalo = 2, kSide = 12, kRow = 16, kZ = 4;
constexpr int tile_index(int x, int y, int z) { return ((x + kHalo) * kSide + y + kHalo) * kRow + z + kZ; }

struct Tile {
  alignas(64) float tsdf[kSide * kSide * kRow];  ///< NaN where unobserved
};

void fill_row(float* out, const Block* block, int row, int begin, int end, int shift, float min_weight) {
  for (int z = begin; z < end; ++z) {
    const float w = block == nullptr ? 0.0f : block->geometry->weight[row + z];
    out[z + shift] = w >= min_weight ? block->geometry->tsdf[row + z] : kNan;
  }
}

void gather(const Map& map, const Block& block, float min_weight, Tile& tile) {
  const Block* near[3][3][3];
  for (int dx = 0; dx < 3; ++dx)
    for (int dy = 0; dy < 3; ++dy)
      for (int dz = 0; dz < 3; ++dz)
        near[dx][dy][dz] = map.store.get({block.coord.x + dx - 1, block.coord.y + dy - 1, block.coord.z + dz - 1});
  for (int x = -kHalo; x < 8 + kHalo; ++x)
    for (int y = -kHalo; y < 8 + kHalo; ++y) {
      float* out = &tile.tsdf[tile_index(x, y, 0)];
      const int row = voxel_offset(x & 7, y & 7, 0);
      const auto& column = near[(x >> 3) + 1][(y >> 3) + 1];
      fill_row(out, column[0], row, 8 - kHalo, 8, -8, min_weight);
      fill_row(out, column[1], row, 0, 8, 0, min_weight);
      fill_row(out, column[2], row, 0, kHalo, 8, min_weight);
    }
}

/// Half the central difference where both neighbours are observed, the one-sided difference where one is.
float difference(float minus, float here, float plus) {
  const bool has_minus = !std::isnan(minus), has_plus = !std::isnan(plus);
  if (has_minus && has_plus) return 0.5f * (plus - minus);
  return has_plus ? plus - here : has_minus ? here - minus : 0.0f;
}

struct Normal {
  float x, y, z;
  float dot(const Normal& o) const { return x * o.x + y * o.y + z * o.z; }
};

Normal normalized(float x, float y, float z) {
  const float length = std::sqrt(x * x + y * y + z * z);
  if (!(length > 0)) return {0, 0, 0};
  const float scale = 1 / length;
  return {x * scale, y * scale, z * scale};
}

/// A voxel of the band within one voxel of the block.
struct BandVoxel {
  int at;      ///< tile index
  int offset;  ///< in the block, -1 outside
};

BlockMask interior_voxels(const Tile& tile, const BlockMask& candidate, float band_m, float cos_limit) {
  BandVoxel band[1000];
  Normal normal[1000];
  int count = 0;
  Normal sum{0, 0, 0};
  for (int x = -1; x <= 8; ++x)
    for (int y = -1; y <= 8; ++y)
      for (int z = -1; z <= 8; ++z) {
        const int at = tile_index(x, y, z);
        const float* v = &tile.tsdf[at];
        if (!(std::abs(*v) <= band_m)) continue;
        const bool inside = ((x | y | z) & ~7) == 0;
        normal[count] = normalized(difference(v[-kSide * kRow], *v, v[kSide * kRow]), difference(v[-kRow], *v, v[kRow]),
                                   difference(v[-1], *v, v[1]));
        sum = {sum.x + normal[count].x, sum.y + normal[count].y, sum.z + normal[count].z};
        band[count++] = {at, inside ? voxel_offset(x, y, z) : -1};
      }
  // Normals within half the limit of one direction are within the limit of each other: most blocks end here.
  const Normal mean = normalized(sum.x, sum.y, sum.z);
  const float cos_half = std::sqrt(0.5f * (1 + cos_limit));
  if (std::all_of(normal, normal + count, [&](const Normal& n) { return n.dot(mean) >= cos_half; })) return candidate;

  int16_t number[kSide * kSide * kRow];
  std::fill_n(number, std::size(number), int16_t(-1));
  for (int i = 0; i < count; ++i) number[band[i].at] = int16_t(i);
  BlockMask interior;
  for (int i = 0; i < count; ++i) {
    if (band[i].offset < 0 || !candidate.test(band[i].offset)) continue;
    bool agrees = true;
    for (int dx = -1; dx <= 1 && agrees; ++dx)
      for (int dy = -1; dy <= 1 && agrees; ++dy)
        for (int dz = -1; dz <= 1; ++dz) {
          const int other = number[band[i].at + (dx * kSide + dy) * kRow + dz];
          agrees = agrees && (other < 0 || other == i || normal[i].dot(normal[other]) >= cos_limit);
        }
    if (agrees) interior.set(band[i].offset);
  }
  return interior;
}

/// Bits where `keep(offset)` holds. Bytes first, eight of which one multiplication gathers: compilers turn the first
/// loop into vector comparisons.
template <typename Keep>
BlockMask where(const Keep& keep) {
  alignas(64) uint8_t kept[kBlockVoxels];
  for (int i = 0; i < kBlockVoxels; ++i) kept[i] = uint8_t(keep(i));
  BlockMask mask;
  for (int i = 0; i < kBlockVoxels; i += 8) {
    uint64_t bytes;
    std::memcpy(&bytes, kept + i, sizeof bytes);
    mask.word[size_t(i >> 6)] |= (bytes * 0x0102040810204080ull >> 56) << (i & 63);
  }
  return mask;
}

BlockMask belongs_to(const Block& block, uint16_t instance) {
  if (block.instance == nullptr) return {};
  const InstancePlanes& planes = *block.instance;
  return where([&](int i) { return (planes.id[i] == instance) & (planes.votes[i] > 0); });
}

BlockMask agrees_with_class(const Block& block, const SurfaceRule& rule) {
  float own[kBlockVoxels] = {}, best[kBlockVoxels] = {}, total[kBlockVoxels] = {};
  for (const EvidencePlane& e : block.evidence) {
    const float* count = e.counts->value;
    if (e.slot == rule.slot) std::copy_n(count, kBlockVoxels, own);
    for (int i = 0; i < kBlockVoxels; ++i) {
      best[i] = std::max(best[i], count[i]);
      total[i] += count[i];
    }
  }
  return where([&](int i) { return (total[i] > 0) & (1 + own[i] >= rule.class_ratio * (1 + best[i])); });
}

BlockMask agrees_with_color(const Block& block, const SurfaceRule& rule) {
  if (block.color == nullptr) return {};
  const ColorPlanes& c = *block.color;
  return where([&](int i) {
    const float r = c.r[i] / 256.0f, g = c.g[i] / 256.0f, b = c.b[i] / 256.0f;
    return c.count[i] > 0 && std::abs(r - rule.color[0]) <= rule.color_change &&
           std::abs(g - rule.color[1]) <= rule.color_change && std::abs(b - rule.color[2]) <= rule.color_change;
  });
}

BlockMask within_radius(const Block& block, const SurfaceRule& rule) {
  const Index3 first = first_voxel(block.coord);
  const float dx = float(first.x - rule.centre.x), dy = float(first.y - rule.centre.y),
              dz = float(first.z - rule.centre.z), limit = rule.radius_voxels * rule.radius_voxels;
  return where([&](int i) {
    const Index3 v = voxel_of_offset(i);
    const float x = dx + float(v.x), y = dy + float(v.y), z = dz + float(v.z);
    return x * x + y * y + z * z <= limit;
  });
}

}  // namespace

BlockMask surface_band(const Block& block, float band_m, float min_weight) {
  const GeometryPlanes& g = *block.geometry;
  return where([&](int i) { return (std::abs(g.tsdf[i]) <= band_m) & (g.weight[i] >= min_weight); });
}

BlockMask candidates(const Block& block, const SurfaceRule& rule) {
  BlockMask mask = surface_band(block, rule.band_m, rule.min_weight);
  if (!mask.any()) return mask;
  if (rule.instance != 0) mask &= belongs_to(block, rule.instance);
  if (rule.slot >= 0) mask &= agrees_with_class(block, rule);
  if (rule.limit_color) mask &= agrees_with_color(block, rule);
  if (std::isfinite(rule.radius_voxels)) mask &= within_radius(block, rule);
  return mask;
}

BlockSurface examine_block(const Map& map, const Block& block, const SurfaceRule& rule) {
  BlockSurface surface;
  surface.candidate = candidates(block, rule);
  if (!surface.candidate.any()) return surface;
  if (rule.cos_normal_change <= -1) {
    surface.interior = surface.candidate;
    return surface;
  }
  Tile tile;
  gather(map, block, rule.min_weight, tile);
  surface.interior = interior_voxels(tile, surface.candidate, rule.band_m, rule.cos_normal_change);
  return surface;
}

Eigen::Vector3f surface_normal(const Map& map, const Index3& voxel, float min_weight) {
  const auto at = [&](int dx, int dy, int dz) {
    const Index3 v{voxel.x + dx, voxel.y + dy, voxel.z + dz};
    const Block* block = map.store.get(block_of_voxel(v));
    const int offset = offset_in_block(v);
    return block != nullptr && block->geometry->weight[offset] >= min_weight ? block->geometry->tsdf[offset] : kNan;
  };
  const float here = at(0, 0, 0);
  if (std::isnan(here)) return Eigen::Vector3f::Zero();
  const Normal n = normalized(difference(at(-1, 0, 0), here, at(1, 0, 0)), difference(at(0, -1, 0), here, at(0, 1, 0)),
                              difference(at(0, 0, -1), here, at(0, 0, 1)));
  return {n.x, n.y, n.z};
}

}  // namespace felt
