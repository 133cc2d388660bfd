#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <functional>

namespace felt {

/// A block is 8^3 voxels, congruent with an OpenVDB leaf: voxel (x, y, z) of the block at offset x << 6 | y << 3 | z.
inline constexpr int kBlockDim = 8;
inline constexpr int kBlockVoxels = 512;

/// Index coordinates of a voxel (its centre is at index * voxel_size_m) or, divided by kBlockDim, of a block.
struct Index3 {
  int32_t x = 0, y = 0, z = 0;
  auto operator<=>(const Index3&) const = default;
};

/// Coordinates in units of blocks: the block holds voxels [8 x, 8 x + 7] and so on.
using BlockCoord = Index3;

inline constexpr int voxel_offset(int x, int y, int z) { return x << 6 | y << 3 | z; }
inline constexpr Index3 voxel_of_offset(int offset) { return {offset >> 6, (offset >> 3) & 7, offset & 7}; }
/// Arithmetic shift: floor division, right for negative indices.
inline constexpr BlockCoord block_of_voxel(const Index3& v) { return {v.x >> 3, v.y >> 3, v.z >> 3}; }
inline constexpr Index3 first_voxel(const BlockCoord& b) { return {b.x * 8, b.y * 8, b.z * 8}; }
/// The voxel of a block at an offset.
inline constexpr Index3 voxel_at(const BlockCoord& b, int offset) {
  const Index3 first = first_voxel(b), in = voxel_of_offset(offset);
  return {first.x + in.x, first.y + in.y, first.z + in.z};
}
inline constexpr int offset_in_block(const Index3& v) { return voxel_offset(v.x & 7, v.y & 7, v.z & 7); }

}  // namespace felt

template <>
struct std::hash<felt::Index3> {
  size_t operator()(const felt::Index3& c) const noexcept {
    // Teschner et al. 2003's primes, then a finaliser: neighbouring blocks must not share low bits.
    uint64_t h = uint64_t(uint32_t(c.x)) * 73856093u ^ uint64_t(uint32_t(c.y)) * 19349669u << 16 ^
                 uint64_t(uint32_t(c.z)) * 83492791u << 32;
    h ^= h >> 31;
    h *= 0x9e3779b97f4a7c15ull;
    return size_t(h ^ h >> 29);
  }
};
