#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "core/text.h"
#include "mapping/regions/region_area.h"
#include "mapping/regions/region_query.h"
#include "mapping/regions/region_surface.h"

namespace felt {
namespace {

/// Bits of a region grown by one voxel, within the region `inside`.
Region grown_inside(const Region& region, const Region& inside) {
  std::vector<BlockMask> bits(inside.blocks());
  for (size_t b = 0; b < region.blocks(); ++b) {
    const std::array<BlockMask, 27> reached = dilated(region.mask[b]);
    const BlockCoord c = region.coord[b];
    for (int i = 0; i < 27; ++i) {
      if (!reached[size_t(i)].any()) continue;
      const BlockMask* to = inside.find({c.x + i / 9 - 1, c.y + i / 3 % 3 - 1, c.z + i % 3 - 1});
      if (to != nullptr) bits[size_t(to - inside.mask.data())] |= reached[size_t(i)] & *to;
    }
  }
  Region out;
  for (size_t b = 0; b < inside.blocks(); ++b)
    if (bits[b].any()) out.append(inside.coord[b], bits[b]);
  return out;
}

/// Sizes of the 26-connected pieces of a region.
std::vector<size_t> piece_sizes(const Region& region) {
  std::vector<BlockMask> left = region.mask, pending(region.blocks());
  std::vector<size_t> sizes;
  for (size_t start = 0; start < region.blocks(); ++start)
    while (left[start].any()) {
      for_each_bit(left[start], [&](int i) { pending[start].word = {}, pending[start].set(i); });
      std::vector<size_t> stack{start};
      size_t size = 0;
      while (!stack.empty()) {
        const size_t b = stack.back();
        stack.pop_back();
        BlockMask grown = pending[b] & left[b];
        pending[b] = {};
        if (!grown.any()) continue;
        for (BlockMask last; !(last == grown);) {
          last = grown;
          grown |= dilated_inside(grown) & left[b];
        }
        left[b] -= grown;
        size += size_t(grown.count());
        const std::array<BlockMask, 27> reached = dilated(grown);
        const BlockCoord c = region.coord[b];
        for (int i = 0; i < 27; ++i) {
          if (!reached[size_t(i)].any()) continue;
          const BlockMask* to = region.find({c.x + i / 9 - 1, c.y + i / 3 % 3 - 1, c.z + i % 3 - 1});
          if (to == nullptr) continue;
          const size_t n = size_t(to - region.mask.data());
          pending[n] |= reached[size_t(i)] & left[n];
          if (pending[n].any()) stack.push_back(n);
        }
      }
      sizes.push_back(size);
    }
  return sizes;
}

/// What one block adds to the summary.
struct Part {
  Index3 lo, hi;
  std::vector<size_t> class_voxels;
  size_t unlabelled = 0, open = 0, boundary = 0;
  BlockMask boundary_bits;
};

Part examine(const Map& map, const Region& region, size_t b, const RegionSettings& settings) {
  const float band_m = float(settings.band_voxels * map.voxel_size_m), min_weight = float(settings.min_weight);
  Part part;
  part.class_voxels.assign(size_t(map.classes.size()), 0);
  const Block& block = *map.store.get(region.coord[b]);
  const Index3 f = first_voxel(region.coord[b]);
  part.lo = {f.x + 8, f.y + 8, f.z + 8};
  part.hi = f;
  for_each_bit(region.mask[b], [&](int i) {
    const Index3 v = voxel_at(block.coord, i);
    part.lo = {std::min(part.lo.x, v.x), std::min(part.lo.y, v.y), std::min(part.lo.z, v.z)};
    part.hi = {std::max(part.hi.x, v.x), std::max(part.hi.y, v.y), std::max(part.hi.z, v.z)};
    const Eigen::Vector3f normal = surface_normal(map, v, min_weight);
    float best = 0;
    int strongest = -1;
    for (const EvidencePlane& e : block.evidence) {
      const float count = e.counts->value[i];
      if (count > best) best = count, strongest = e.slot;
    }
    ++(strongest < 0 ? part.unlabelled : part.class_voxels[size_t(strongest)]);

    bool open = false, other = false;
    for (int n = 0; n < 27 && !(open && other); ++n) {
      const Index3 d{n / 9 - 1, n / 3 % 3 - 1, n % 3 - 1}, u{v.x + d.x, v.y + d.y, v.z + d.z};
      const Block* near = map.store.get(block_of_voxel(u));
      const int at = offset_in_block(u);
      const bool observed = near != nullptr && near->geometry->weight[at] >= min_weight;
      const bool face = std::abs(d.x) + std::abs(d.y) + std::abs(d.z) == 1;
      // Only a step along the surface leaves it: behind it nothing is ever observed.
      if (!observed && face && std::abs(normal.dot(Eigen::Vector3f(float(d.x), float(d.y), float(d.z)))) < 0.5f)
        open = true;
      if (observed && std::abs(near->geometry->tsdf[at]) <= band_m && !region.contains(u)) other = true;
    }
    part.open += open;
    part.boundary += open || other;
    if (open || other) part.boundary_bits.set(i);
  });
  return part;
}

std::string percent(double fraction) { return number_text(100 * fraction, "%.0f %%"); }

}  // namespace

RegionSummary summarize(const Map& map, const Region& region, const RegionSettings& settings) {
  RegionSummary out;
  const size_t k = size_t(map.classes.size());
  std::vector<Part> parts(region.blocks());
  tbb::parallel_for(size_t(0), region.blocks(), [&](size_t b) { parts[b] = examine(map, region, b, settings); });
  out.area_m2 = surface_area_m2(map, region, settings);
  out.voxels = region.voxels();
  out.blocks = region.blocks();
  out.class_voxels.assign(k, 0);
  Region boundary;
  size_t open = 0;
  Eigen::Array3d lo = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity()), hi = -lo;
  for (size_t b = 0; b < parts.size(); ++b) {
    const Part& part = parts[b];
    lo = lo.min(Eigen::Array3d(part.lo.x, part.lo.y, part.lo.z));
    hi = hi.max(Eigen::Array3d(part.hi.x, part.hi.y, part.hi.z));
    for (size_t c = 0; c < k; ++c) out.class_voxels[c] += part.class_voxels[c];
    out.unlabelled_voxels += part.unlabelled;
    out.boundary_voxels += part.boundary;
    open += part.open;
    if (part.boundary_bits.any()) boundary.append(region.coord[b], part.boundary_bits);
  }
  out.min_m = lo.matrix() * map.voxel_size_m;
  out.max_m = hi.matrix() * map.voxel_size_m;

  const size_t labelled = out.voxels - out.unlabelled_voxels;
  if (labelled > 0)
    out.mixed_fraction =
        1 - double(*std::max_element(out.class_voxels.begin(), out.class_voxels.end())) / double(labelled);
  if (out.boundary_voxels > 0) out.open_boundary_fraction = double(open) / double(out.boundary_voxels);
  const std::vector<size_t> pieces = piece_sizes(subtracted(region, grown_inside(boundary, region)));
  size_t eroded = 0;
  for (const size_t n : pieces) eroded += n;
  const auto large = std::count_if(pieces.begin(), pieces.end(), [&](size_t n) { return 20 * n >= eroded; });
  out.necks = std::max(0, int(large) - 1);

  if (out.necks > 0)
    out.warnings.push_back("necks: " + std::to_string(out.necks + 1) + " parts that only narrow bridges join");
  if (out.mixed_fraction > 0.1)
    out.warnings.push_back("mixed classes: " + percent(out.mixed_fraction) +
                           " of the labelled voxels are another class");
  if (out.open_boundary_fraction > 0.5)
    out.warnings.push_back("open boundary: " + percent(out.open_boundary_fraction) +
                           " of it ends at unobserved space: the surface may go on");
  return out;
}

}  // namespace felt
