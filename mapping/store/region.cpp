#include "mapping/store/region.h"

#include <algorithm>

namespace felt {
namespace {

constexpr uint64_t kZ0 = 0x0101010101010101ull, kZ7 = 0x8080808080808080ull;

/// Merges two sorted lists of blocks; `combine(a, b)` gets zero masks where a side has no such block.
template <typename Combine>
Region merged(const Region& a, const Region& b, const Combine& combine) {
  Region out;
  size_t i = 0, j = 0;
  while (i < a.blocks() || j < b.blocks()) {
    const bool take_a = j == b.blocks() || (i < a.blocks() && a.coord[i] <= b.coord[j]);
    const bool take_b = i == a.blocks() || (j < b.blocks() && b.coord[j] <= a.coord[i]);
    const BlockCoord coord = take_a ? a.coord[i] : b.coord[j];
    const BlockMask bits = combine(take_a ? a.mask[i] : BlockMask{}, take_b ? b.mask[j] : BlockMask{});
    if (bits.any()) out.append(coord, bits);
    i += take_a;
    j += take_b;
  }
  return out;
}

uint64_t spread_y(uint64_t w) { return w | w << 8 | w >> 8; }

uint64_t spread_z(uint64_t w) { return w | (w << 1 & ~kZ0) | (w >> 1 & ~kZ7); }

}  // namespace

size_t Region::voxels() const {
  size_t n = 0;
  for (const BlockMask& bits : mask) n += size_t(bits.count());
  return n;
}

const BlockMask* Region::find(const BlockCoord& block) const {
  const auto at = std::lower_bound(coord.begin(), coord.end(), block);
  return at != coord.end() && *at == block ? &mask[size_t(at - coord.begin())] : nullptr;
}

bool Region::contains(const Index3& voxel) const {
  const BlockMask* bits = find(block_of_voxel(voxel));
  return bits != nullptr && bits->test(offset_in_block(voxel));
}

Region united(const Region& a, const Region& b) {
  return merged(a, b, [](const BlockMask& x, const BlockMask& y) { return x | y; });
}

Region intersected(const Region& a, const Region& b) {
  return merged(a, b, [](const BlockMask& x, const BlockMask& y) { return x & y; });
}

Region subtracted(const Region& a, const Region& b) {
  return merged(a, b, [](const BlockMask& x, const BlockMask& y) { return x - y; });
}

BlockMask dilated_inside(const BlockMask& bits) {
  std::array<uint64_t, 8> plane;
  for (int x = 0; x < 8; ++x) plane[x] = spread_y(spread_z(bits.word[x]));
  BlockMask out;
  for (int x = 0; x < 8; ++x) out.word[x] = plane[x] | (x > 0 ? plane[x - 1] : 0) | (x < 7 ? plane[x + 1] : 0);
  return out;
}

std::array<BlockMask, 27> dilated(const BlockMask& bits) {
  std::array<BlockMask, 27> out{};
  // Per x plane: nine words for (dy, dz); planes then spread along x.
  for (int x = 0; x < 8; ++x) {
    const uint64_t w = bits.word[x];
    if (w == 0) continue;
    const uint64_t by_z[3] = {(w & kZ0) << 7, spread_z(w), (w & kZ7) >> 7};
    for (int dz = 0; dz < 3; ++dz) {
      const uint64_t v = by_z[dz];
      if (v == 0) continue;
      const uint64_t by_y[3] = {v << 56, spread_y(v), v >> 56};
      for (int dy = 0; dy < 3; ++dy) {
        const uint64_t u = by_y[dy];
        const int side = 3 * dy + dz;
        out[9 + side].word[x] |= u;
        if (x > 0)
          out[9 + side].word[x - 1] |= u;
        else
          out[side].word[7] |= u;
        if (x < 7)
          out[9 + side].word[x + 1] |= u;
        else
          out[18 + side].word[0] |= u;
      }
    }
  }
  return out;
}

}  // namespace felt
