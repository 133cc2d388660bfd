#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapping/regions/interior_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "core/simd.h"
#include "mapping/regions/interior_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace felt::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, 8>;  // a row of the block
using FloatVec = hn::Vec<FloatTag>;
using FloatMask = hn::Mask<FloatTag>;
constexpr FloatTag kF;

constexpr int kHalo = SurfaceTile::kHalo, kSide = SurfaceTile::kSide, kRow = SurfaceTile::kRow,
              kStepX = SurfaceTile::kStepX, kStepY = SurfaceTile::kStepY, kFirstZ = SurfaceTile::kFirstZ;
/// What a voxel outside the band adds to a product of normals, so that it agrees with every neighbour.
constexpr float kAgrees = 4;

/// Of every voxel of a tile (and a row before and after, which unaligned loads may touch).
struct Planes {
  alignas(64) float sum_z[kSide * kSide * kRow], rise_z[kSide * kSide * kRow];
  alignas(64) float x[kSide * kSide * kRow], y[kSide * kSide * kRow], z[kSide * kSide * kRow];
  alignas(64) float outside[kSide * kSide * kRow];  ///< 0 in the band, else kAgrees
};

/// Places along a row, from its first on, that lie within a voxel of a candidate: often one vector covers them.
struct Extent {
  int begin, end;
};

Extent extent_along_rows(const std::array<uint64_t, 8>& candidate) {
  uint64_t any = 0;
  for (const uint64_t word : candidate) any |= word;
  any |= any >> 32;
  any |= any >> 16;
  any |= any >> 8;
  const unsigned z = unsigned(any & 0xff);
  return {kFirstZ + __builtin_ctz(z) - 1, kFirstZ + 31 - __builtin_clz(z) + 2};
}

/// Calls `visit(first)` for vectors that cover the extent of the row at `row`: some overlap, all stay within z = -1
/// .. 8.
template <typename Visit>
HWY_INLINE void along_row(int row, const Extent& extent, const Visit& visit) {
  const int lanes = int(hn::Lanes(kF)), last = std::max(extent.end - lanes, kFirstZ - 1);
  for (int z = std::min(extent.begin, last);; z += lanes) {
    visit(row + std::min(z, last));
    if (z >= last) return;
  }
}

/// Calls `visit(row, x, y)` for rows named by `rows`, x and y from -2 on.
template <typename Visit>
HWY_INLINE void for_each_row(const std::array<uint16_t, kSide>& rows, const Visit& visit) {
  for (int x = 0; x < kSide; ++x)
    for (unsigned left = rows[size_t(x)]; left != 0; left &= left - 1) {
      const int y = __builtin_ctz(left);
      visit(x * kStepX + y * kStepY, x - kHalo, y - kHalo);
    }
}

HWY_INLINE FloatVec at(const float* plane, int place) { return hn::LoadU(kF, plane + place); }

/// The specification's sums, and the specification itself where they meet a voxel that was not observed.
HWY_INLINE void measure_normals(const SurfaceTile& tile, const FloatVec band, int first, Planes& p, FloatVec sum[3]) {
  const FloatMask in_band = hn::Le(hn::Abs(at(tile.tsdf, first)), band);
  const FloatVec none = hn::Zero(kF);
  hn::StoreU(hn::IfThenElse(in_band, none, hn::Set(kF, kAgrees)), kF, p.outside + first);
  if (hn::AllFalse(kF, in_band)) {
    for (float* plane : {p.x, p.y, p.z}) hn::StoreU(none, kF, plane + first);
    return;
  }
  const auto plate = [&](int centre, int aside) HWY_ATTR {
    const int c = first + centre;
    return hn::Add(hn::Add(at(p.sum_z, c - aside), at(p.sum_z, c)), at(p.sum_z, c + aside));
  };
  const auto rises = [&](int row) HWY_ATTR {
    const int r = first + row;
    return hn::Add(hn::Add(at(p.rise_z, r - kStepY), at(p.rise_z, r)), at(p.rise_z, r + kStepY));
  };
  const FloatVec x = hn::Sub(plate(kStepX, kStepY), plate(-kStepX, kStepY));
  const FloatVec y = hn::Sub(plate(kStepY, kStepX), plate(-kStepY, kStepX));
  const FloatVec z = hn::Add(hn::Add(rises(-kStepX), rises(0)), rises(kStepX));
  const FloatVec length = hn::Sqrt(hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z)));
  const FloatMask known = hn::And(in_band, hn::Gt(length, none));  // false for NaN
  const FloatVec scale = hn::IfThenElseZero(known, hn::Div(hn::Set(kF, 1.0f), length));
  const FloatVec n[3] = {hn::IfThenElseZero(known, hn::Mul(x, scale)), hn::IfThenElseZero(known, hn::Mul(y, scale)),
                         hn::IfThenElseZero(known, hn::Mul(z, scale))};
  float* const planes[3] = {p.x, p.y, p.z};
  for (int c = 0; c < 3; ++c) {
    hn::StoreU(n[c], kF, planes[c] + first);
    sum[c] = hn::Add(sum[c], n[c]);
  }
  const FloatMask partly = hn::And(in_band, hn::IsNaN(length));
  if (hn::AllFalse(kF, partly)) return;
  alignas(32) uint8_t bits[8] = {};
  hn::StoreMaskBits(kF, partly, bits);
  for (int lane = 0; lane < int(hn::Lanes(kF)); ++lane) {
    if (!(bits[0] >> lane & 1)) continue;
    const SurfaceNormal one = smoothed_normal(tile, first + lane);
    p.x[first + lane] = one.x, p.y[first + lane] = one.y, p.z[first + lane] = one.z;
  }
}

/// Whether all normals lie so near to one direction that each two of them agree, with room for rounding. Any direction
/// would do: their sum decides nothing but how often this holds.
HWY_INLINE bool within_a_cone(const Planes& p, const FloatVec sum[3], const std::array<uint16_t, kSide>& rows,
                              const Extent& extent, float cos_limit) {
  float axis[3];
  for (int c = 0; c < 3; ++c) axis[c] = hn::GetLane(hn::SumOfLanes(kF, sum[c]));
  const float length = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
  if (!(length > 0)) return false;
  const FloatVec x = hn::Set(kF, axis[0] / length), y = hn::Set(kF, axis[1] / length),
                 z = hn::Set(kF, axis[2] / length);
  const FloatVec least = hn::Set(kF, std::sqrt(0.5f * (1 + cos_limit)) + 1e-4f);
  FloatMask all = hn::Eq(x, x);
  for_each_row(rows, [&](int row, int, int) HWY_ATTR {
    along_row(row, extent, [&](int i) HWY_ATTR {
      const FloatVec product = hn::Add(hn::Add(hn::Mul(at(p.x, i), x), hn::Mul(at(p.y, i), y)),
                                       hn::Add(hn::Mul(at(p.z, i), z), at(p.outside, i)));
      all = hn::And(all, hn::Ge(product, least));
    });
  });
  return hn::AllTrue(kF, all);
}

/// Words of masks, not masks: GCC 12 lets temporaries of 64-byte-aligned types lie at multiples of 32, which
/// instructions of AVX-512 for aligned data must not meet.
std::array<uint64_t, 8> interior_voxels(const SurfaceTile& tile, const std::array<uint64_t, 8>& candidate, float band_m,
                                        float cos_limit) {
  const int lanes = int(hn::Lanes(kF));
  if (std::all_of(candidate.begin(), candidate.end(), [](uint64_t word) { return word == 0; })) return candidate;
  const Extent extent = extent_along_rows(candidate);
  Planes p;
  for_each_row(rows_near(candidate, 2), [&](int row, int, int) HWY_ATTR {
    along_row(row, extent, [&](int i) HWY_ATTR {
      const FloatVec below = at(tile.tsdf, i - 1), above = at(tile.tsdf, i + 1);
      hn::StoreU(hn::Add(hn::Add(below, at(tile.tsdf, i)), above), kF, p.sum_z + i);
      hn::StoreU(hn::Sub(above, below), kF, p.rise_z + i);
    });
  });
  const std::array<uint16_t, kSide> near = rows_near(candidate, 1);
  FloatVec sum[3] = {hn::Zero(kF), hn::Zero(kF), hn::Zero(kF)};
  const FloatVec band = hn::Set(kF, band_m);
  for_each_row(near, [&](int row, int, int) HWY_ATTR {
    along_row(row, extent, [&](int i) HWY_ATTR { measure_normals(tile, band, i, p, sum); });
  });
  if (within_a_cone(p, sum, near, extent, cos_limit)) return candidate;

  std::array<uint64_t, 8> interior{};
  const FloatVec least = hn::Set(kF, cos_limit);
  for_each_row(rows_near(candidate, 0), [&](int row, int bx, int by) HWY_ATTR {
    uint64_t agreeing = 0;
    for (int z = 0; z < 8; z += lanes) {
      const int i = row + kFirstZ + z;
      const FloatVec x = at(p.x, i), y = at(p.y, i), zz = at(p.z, i);
      FloatMask all = hn::Eq(least, least);
      for (int dx = -kStepX; dx <= kStepX; dx += kStepX)
        for (int dy = -kStepY; dy <= kStepY; dy += kStepY)
          for (int dz = -1; dz <= 1; ++dz) {
            const int o = i + dx + dy + dz;
            if (o == i) continue;
            const FloatVec product =
                hn::Add(hn::Add(hn::Mul(x, at(p.x, o)), hn::Mul(y, at(p.y, o))), hn::Mul(zz, at(p.z, o)));
            all = hn::And(all, hn::Ge(hn::Add(product, at(p.outside, o)), least));
          }
      uint8_t bits[8] = {};
      hn::StoreMaskBits(kF, all, bits);
      agreeing |= uint64_t(bits[0]) << z;
    }
    interior[size_t(bx)] |= agreeing << (8 * by);
  });
  for (size_t x = 0; x < 8; ++x) interior[x] &= candidate[x];
  return interior;
}

}  // namespace felt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {

HWY_EXPORT(interior_voxels);

BlockMask interior_voxels(const SurfaceTile& tile, const BlockMask& candidate, float band_m, float cos_limit) noexcept {
  if (simd_scalar_forced()) return interior_voxels_scalar(tile, candidate, band_m, cos_limit);
  return {HWY_DYNAMIC_DISPATCH(interior_voxels)(tile, candidate.word, band_m, cos_limit)};
}

}  // namespace felt
#endif
