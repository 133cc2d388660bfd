#include "mapping/regions/map_segments.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "mapping/regions/region_surface.h"

namespace felt {
namespace {

constexpr uint32_t kNone = 0xffffffff;
constexpr float kUnobserved = std::numeric_limits<float>::quiet_NaN();

struct Step {
  int x, y, z;
};

/// The 26 steps to a voxel's neighbours in ascending order: 13 back, then 13 ahead.
constexpr std::array<Step, 26> neighbour_steps() {
  std::array<Step, 26> steps{};
  size_t n = 0;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z)
        if (x != 0 || y != 0 || z != 0) steps[n++] = {x, y, z};
  return steps;
}
constexpr std::array<Step, 26> kSteps = neighbour_steps();

/// What decides whether a voxel is joined to another, lengths in voxels.
struct SurfaceVoxel {
  float normal[3];
  float point[3];  ///< nearest point of the surface, from the centre of the voxel
  float lab[3];
  int32_t slot;  ///< strongest class, -1: none
};

/// The surface voxels of a map, numbered block by block in canonical order.
class Surface {
public:
  Surface(const Map& map, const MapSegmentSettings& settings);

  uint32_t size() const { return uint32_t(voxel.size()); }
  size_t blocks() const { return block_.size(); }
  const BlockMask& mask(size_t b) const { return mask_[b]; }
  const BlockCoord& coord(size_t b) const { return block_[b]->coord; }
  uint32_t first(size_t b) const { return first_[b]; }
  /// Number of the voxel at (x, y, z) from the first voxel of block `b`, each coordinate in -1 .. 8; kNone where it is
  /// not of the surface.
  uint32_t number(size_t b, int x, int y, int z) const {
    const int32_t other = near_[b][size_t(near_index(x, y, z))];
    if (other < 0) return kNone;
    const int offset = voxel_offset(x & 7, y & 7, z & 7);
    const BlockMask& bits = mask_[size_t(other)];
    if (!bits.test(offset)) return kNone;
    uint32_t rank = first_[size_t(other)];
    for (int w = 0; w < offset >> 6; ++w) rank += uint32_t(std::popcount(bits.word[size_t(w)]));
    return rank + uint32_t(std::popcount(bits.word[size_t(offset >> 6)] & ((uint64_t(1) << (offset & 63)) - 1)));
  }

  std::vector<SurfaceVoxel> voxel;

private:
  static int near_index(int x, int y, int z) { return 9 * ((x >> 3) + 1) + 3 * ((y >> 3) + 1) + (z >> 3) + 1; }
  void measure(const Map& map, const MapSegmentSettings& settings, size_t b);

  std::vector<const Block*> block_;
  std::vector<BlockMask> mask_;
  std::vector<uint32_t> first_;
  std::vector<std::array<int32_t, 27>> near_;  ///< positions of the block's neighbours in `block_`, -1: none
};

Surface::Surface(const Map& map, const MapSegmentSettings& settings) {
  const float band_m = float(settings.band_voxels * map.voxel_size_m);
  std::vector<int32_t> position(map.store.size(), -1);
  uint32_t count = 0;
  for (const uint32_t n : map.store.sorted()) {
    const BlockMask bits = surface_band(map.store[n], band_m, float(settings.min_weight));
    if (!bits.any()) continue;
    position[n] = int32_t(block_.size());
    block_.push_back(&map.store[n]);
    mask_.push_back(bits);
    first_.push_back(count);
    count += uint32_t(bits.count());
  }
  voxel.resize(count);
  near_.resize(block_.size());
  tbb::parallel_for(size_t(0), block_.size(), [&](size_t b) {
    const BlockCoord& c = block_[b]->coord;
    for (int i = 0; i < 27; ++i) {
      const uint32_t n = map.store.find({c.x + i / 9 - 1, c.y + i / 3 % 3 - 1, c.z + i % 3 - 1});
      near_[b][size_t(i)] = n == BlockStore::kNone ? -1 : position[n];
    }
    measure(map, settings, b);
  });
}

/// CIE Lab (D65) of a linear mix of sRGB values in 0 .. 255.
void lab_of(float r, float g, float b, float lab[3]) {
  const auto linear = [](float v) {
    return v <= 10.31475f ? v / 3294.6f : std::pow((v / 255 + 0.055f) / 1.055f, 2.4f);
  };
  const auto root = [](float t) { return t > 0.008856452f ? std::cbrt(t) : t * 7.787037f + 0.13793103f; };
  r = linear(r), g = linear(g), b = linear(b);
  const float x = root((0.4124564f * r + 0.3575761f * g + 0.1804375f * b) / 0.95047f);
  const float y = root(0.2126729f * r + 0.7151522f * g + 0.0721750f * b);
  const float z = root((0.0193339f * r + 0.1191920f * g + 0.9503041f * b) / 1.08883f);
  lab[0] = 116 * y - 16, lab[1] = 500 * (x - y), lab[2] = 200 * (y - z);
}

void Surface::measure(const Map& map, const MapSegmentSettings& settings, size_t b) {
  const Block& block = *block_[b];
  const Block* near[27];
  for (int i = 0; i < 27; ++i)
    near[i] = map.store.get({block.coord.x + i / 9 - 1, block.coord.y + i / 3 % 3 - 1, block.coord.z + i % 3 - 1});
  const auto tsdf = [&](int x, int y, int z) {
    const Block* const at = near[near_index(x, y, z)];
    const int offset = voxel_offset(x & 7, y & 7, z & 7);
    return at != nullptr && double(at->geometry->weight[offset]) >= settings.min_weight ? at->geometry->tsdf[offset]
                                                                                        : kUnobserved;
  };
  // Central difference, one-sided beside what was never observed.
  const auto difference = [](float minus, float here, float plus) {
    if (!std::isnan(minus) && !std::isnan(plus)) return 0.5f * (plus - minus);
    return !std::isnan(plus) ? plus - here : !std::isnan(minus) ? here - minus : 0.0f;
  };
  const float per_voxel = float(1 / map.voxel_size_m);
  uint32_t n = first_[b];
  for_each_bit(mask_[b], [&](int offset) {
    SurfaceVoxel& out = voxel[n++];
    const Index3 v = voxel_of_offset(offset);
    const float here = block.geometry->tsdf[offset];
    const float gx = difference(tsdf(v.x - 1, v.y, v.z), here, tsdf(v.x + 1, v.y, v.z));
    const float gy = difference(tsdf(v.x, v.y - 1, v.z), here, tsdf(v.x, v.y + 1, v.z));
    const float gz = difference(tsdf(v.x, v.y, v.z - 1), here, tsdf(v.x, v.y, v.z + 1));
    const float length = std::sqrt(gx * gx + gy * gy + gz * gz), scale = length > 0 ? 1 / length : 0.0f;
    const float normal[3] = {gx * scale, gy * scale, gz * scale};
    for (int i = 0; i < 3; ++i) {
      out.normal[i] = normal[i];
      out.point[i] = -here * per_voxel * normal[i];
      out.lab[i] = 0;
    }
    out.slot = -1;
    float most = 0;
    for (const EvidencePlane& e : block.evidence)
      if (e.counts->value[offset] > most) most = e.counts->value[offset], out.slot = e.slot;
    if (settings.color_change > 0 && block.color != nullptr)
      lab_of(block.color->r[offset] / 256.0f, block.color->g[offset] / 256.0f, block.color->b[offset] / 256.0f,
             out.lab);
  });
}

/// Whether two voxels, one `step` apart, are of one smooth surface.
class Agreement {
public:
  explicit Agreement(const MapSegmentSettings& s)
      : least_cos_(float(std::cos(s.normal_change_deg * std::numbers::pi / 180))),
        plane_(float(s.plane_distance_voxels)),
        color2_(s.color_change > 0 ? float(s.color_change * s.color_change) : std::numeric_limits<float>::infinity()),
        classes_(s.classes) {}

  bool operator()(const SurfaceVoxel& a, const SurfaceVoxel& b, const Step& step) const {
    const float between[3] = {float(step.x) + b.point[0] - a.point[0], float(step.y) + b.point[1] - a.point[1],
                              float(step.z) + b.point[2] - a.point[2]};
    return dot(a.normal, b.normal) >= least_cos_ && std::fabs(dot(a.normal, between)) <= plane_ &&
           std::fabs(dot(b.normal, between)) <= plane_ && !(distance2(a.lab, b.lab) > color2_) && same_class(a, b);
  }
  bool same_class(const SurfaceVoxel& a, const SurfaceVoxel& b) const {
    return !classes_ || a.slot == b.slot || a.slot < 0 || b.slot < 0;
  }

private:
  static float dot(const float* a, const float* b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
  static float distance2(const float* a, const float* b) {
    const float d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    return dot(d, d);
  }
  float least_cos_, plane_, color2_;
  bool classes_;
};

/// Per voxel a bit for each of the 13 neighbours ahead that it is joined to.
std::vector<uint16_t> joins_of(const Surface& surface, const Agreement& agree) {
  std::vector<uint16_t> joins(surface.size(), 0);
  tbb::parallel_for(size_t(0), surface.blocks(), [&](size_t b) {
    uint32_t n = surface.first(b);
    for_each_bit(surface.mask(b), [&](int offset) {
      const Index3 v = voxel_of_offset(offset);
      for (size_t i = 0; i < 13; ++i) {
        const Step& s = kSteps[13 + i];
        const uint32_t other = surface.number(b, v.x + s.x, v.y + s.y, v.z + s.z);
        if (other != kNone && agree(surface.voxel[n], surface.voxel[other], s)) joins[n] |= uint16_t(1 << i);
      }
      ++n;
    });
  });
  return joins;
}

/// Roots of the joined voxels: the first voxel of each piece stands for it.
std::vector<uint32_t> pieces_of(const Surface& surface, const std::vector<uint16_t>& joins) {
  std::vector<uint32_t> parent(surface.size());
  for (uint32_t n = 0; n < surface.size(); ++n) parent[n] = n;
  const auto root = [&](uint32_t n) {
    while (parent[n] != n) n = parent[n] = parent[parent[n]];
    return n;
  };
  for (size_t b = 0; b < surface.blocks(); ++b) {
    uint32_t n = surface.first(b);
    for_each_bit(surface.mask(b), [&](int offset) {
      const Index3 v = voxel_of_offset(offset);
      for (uint32_t bits = joins[n]; bits != 0; bits &= bits - 1) {
        const Step& s = kSteps[13 + size_t(std::countr_zero(bits))];
        const uint32_t a = root(n), c = root(surface.number(b, v.x + s.x, v.y + s.y, v.z + s.z));
        parent[std::max(a, c)] = std::min(a, c);
      }
      ++n;
    });
  }
  for (uint32_t n = 0; n < surface.size(); ++n) parent[n] = root(n);
  return parent;
}

/// Position of each voxel: its block in the surface and its offset.
struct Place {
  uint32_t block;
  uint16_t offset;
};
std::vector<Place> places_of(const Surface& surface) {
  std::vector<Place> places;
  places.reserve(surface.size());
  for (size_t b = 0; b < surface.blocks(); ++b)
    for_each_bit(surface.mask(b), [&](int offset) { places.push_back({uint32_t(b), uint16_t(offset)}); });
  return places;
}

/// Gives voxels without a piece that of a neighbour, wave by wave, where `may` holds for the two.
template <typename May>
void grow(const Surface& surface, const std::vector<Place>& places, const May& may, std::vector<uint32_t>& piece) {
  std::vector<uint32_t> wave, next;
  const auto spread = [&](uint32_t n) {
    const Index3 v = voxel_of_offset(places[n].offset);
    for (const Step& s : kSteps) {
      const uint32_t other = surface.number(places[n].block, v.x + s.x, v.y + s.y, v.z + s.z);
      if (other == kNone || piece[other] != kNone || !may(surface.voxel[n], surface.voxel[other])) continue;
      piece[other] = piece[n];
      next.push_back(other);
    }
  };
  for (uint32_t n = 0; n < surface.size(); ++n)
    if (piece[n] != kNone) wave.push_back(n);
  while (!wave.empty()) {
    for (const uint32_t n : wave) spread(n);
    wave.swap(next);
    next.clear();
  }
}

std::vector<Region> regions_of(const Surface& surface, const std::vector<Place>& places,
                               const std::vector<uint32_t>& piece) {
  std::vector<uint32_t> number(surface.size(), kNone);
  std::vector<Region> regions;
  for (uint32_t n = 0; n < surface.size(); ++n) {
    if (piece[n] == kNone) continue;
    uint32_t& r = number[piece[n]];
    if (r == kNone) {
      r = uint32_t(regions.size());
      regions.emplace_back();
    }
    Region& region = regions[r];
    const BlockCoord& coord = surface.coord(places[n].block);
    if (region.empty() || region.coord.back() != coord) region.append(coord, {});
    region.mask.back().set(places[n].offset);
  }
  return regions;
}

}  // namespace

MapSegmentSettings map_segment_settings(const RegionSettings& settings) {
  MapSegmentSettings out;
  out.band_voxels = settings.band_voxels;
  out.min_weight = settings.min_weight;
  out.color_change = std::isfinite(settings.color_change) ? settings.color_change : 0;
  return out;
}

std::vector<Region> map_segments(const Map& map, const MapSegmentSettings& settings) {
  const Surface surface(map, settings);
  const Agreement agree(settings);
  std::vector<uint32_t> piece = pieces_of(surface, joins_of(surface, agree));
  std::vector<uint32_t> size(surface.size(), 0);
  for (const uint32_t p : piece) ++size[p];
  for (uint32_t& p : piece)
    if (size[p] < settings.min_voxels) p = kNone;
  const std::vector<Place> places = places_of(surface);
  grow(
      surface, places, [&](const auto& a, const auto& b) { return agree.same_class(a, b); }, piece);
  grow(
      surface, places, [](const auto&, const auto&) { return true; }, piece);
  return regions_of(surface, places, piece);
}

}  // namespace felt
