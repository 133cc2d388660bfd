#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapping/label_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "core/simd.h"
#include "mapping/label_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace felt::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A vector is at most two rows of a block, so that row masks fit every target.
using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::RebindToSigned<FloatTag>;
using FloatMask = hn::Mask<FloatTag>;
constexpr FloatTag kF;
constexpr IntTag kI;

/// Bits of lanes [i, i + N): whole bytes, or a part of one where vectors are shorter than a row.
HWY_INLINE unsigned bits_at(const uint8_t* rows, int i) {
  const int lanes = int(hn::Lanes(kF));
  if (lanes == 16) return unsigned(rows[i / 8]) | unsigned(rows[i / 8 + 1]) << 8;
  return unsigned(rows[i / 8]) >> (i & 7) & ((1u << lanes) - 1);
}

HWY_INLINE void put_bits(unsigned bits, uint8_t* rows, int i) {
  const int lanes = int(hn::Lanes(kF));
  if (lanes >= 8) {
    rows[i / 8] = uint8_t(bits);
    if (lanes == 16) rows[i / 8 + 1] = uint8_t(bits >> 8);
  } else {
    const unsigned others = ~(((1u << lanes) - 1) << (i & 7));
    rows[i / 8] = uint8_t((rows[i / 8] & others) | bits << (i & 7));
  }
}

HWY_INLINE FloatMask mask_of(unsigned bits) {
  uint8_t bytes[8] = {uint8_t(bits), uint8_t(bits >> 8)};  // eight because some targets read that many
  return hn::LoadMaskBits(kF, bytes);
}

HWY_INLINE unsigned bits_of(FloatMask mask) {
  uint8_t bytes[8] = {};
  hn::StoreMaskBits(kF, mask, bytes);
  return unsigned(bytes[0]) | unsigned(bytes[1]) << 8;
}

bool select_band(const BlockObservation& observation, float band_m, LaneBits& band) {
  const int lanes = int(hn::Lanes(kF));
  const auto limit = hn::Set(kF, band_m);
  unsigned any = 0;
  for (int i = 0; i < kBlockVoxels; i += lanes) {
    unsigned bits = bits_at(observation.valid, i);
    if (bits != 0) bits &= bits_of(hn::Lt(hn::Abs(hn::Load(kF, observation.sdf_m + i)), limit));
    put_bits(bits, band.row, i);
    any |= bits;
  }
  return any != 0;
}

int take_equal(const int32_t* ids, int32_t id, LaneBits& rest, LaneBits& taken) {
  const int lanes = int(hn::Lanes(kF));
  const auto wanted = hn::Set(kI, id);
  int count = 0;
  for (int i = 0; i < kBlockVoxels; i += lanes) {
    const unsigned before = bits_at(rest.row, i);
    unsigned bits = 0;
    if (before != 0) {
      bits = before & bits_of(hn::RebindMask(kF, hn::Eq(hn::LoadU(kI, ids + i), wanted)));
      put_bits(before & ~bits, rest.row, i);
      count += __builtin_popcount(bits);
    }
    put_bits(bits, taken.row, i);
  }
  return count;
}

void add_evidence(const LaneBits& lanes_in, float amount, Plane& plane) {
  const int lanes = int(hn::Lanes(kF));
  const auto added = hn::Set(kF, amount);
  for (int i = 0; i < kBlockVoxels; i += lanes) {
    const unsigned bits = bits_at(lanes_in.row, i);
    if (bits == 0) continue;
    const auto value = hn::Load(kF, plane.value + i);
    hn::Store(hn::IfThenElse(mask_of(bits), hn::Add(value, added), value), kF, plane.value + i);
  }
}

void fade_evidence(const LaneBits& lanes_in, std::span<Plane* const> planes, float added, float max_evidence) {
  const int lanes = int(hn::Lanes(kF));
  const auto room = hn::Set(kF, std::max(0.0f, max_evidence - added));
  for (int i = 0; i < kBlockVoxels; i += lanes) {
    const unsigned bits = bits_at(lanes_in.row, i);
    if (bits == 0) continue;
    auto total = hn::Zero(kF);
    for (const Plane* plane : planes) total = hn::Add(total, hn::Load(kF, plane->value + i));
    const FloatMask over = hn::And(mask_of(bits), hn::Gt(total, room));
    if (hn::AllFalse(kF, over)) continue;
    const auto keep = hn::Div(room, total);
    for (Plane* plane : planes) {
      const auto value = hn::Load(kF, plane->value + i);
      hn::Store(hn::IfThenElse(over, hn::Mul(value, keep), value), kF, plane->value + i);
    }
  }
}

}  // namespace felt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {

HWY_EXPORT(select_band);
HWY_EXPORT(take_equal);
HWY_EXPORT(add_evidence);
HWY_EXPORT(fade_evidence);

bool select_band(const BlockObservation& observation, float band_m, LaneBits& band) noexcept {
  return simd_scalar_forced() ? select_band_scalar(observation, band_m, band)
                              : HWY_DYNAMIC_DISPATCH(select_band)(observation, band_m, band);
}

int take_equal(const int32_t ids[kBlockVoxels], int32_t id, LaneBits& rest, LaneBits& taken) noexcept {
  return simd_scalar_forced() ? take_equal_scalar(ids, id, rest, taken)
                              : HWY_DYNAMIC_DISPATCH(take_equal)(ids, id, rest, taken);
}

void add_evidence(const LaneBits& lanes, float amount, Plane& plane) noexcept {
  if (simd_scalar_forced()) return add_evidence_scalar(lanes, amount, plane);
  HWY_DYNAMIC_DISPATCH(add_evidence)(lanes, amount, plane);
}

void fade_evidence(const LaneBits& lanes, std::span<Plane* const> planes, float added, float max_evidence) noexcept {
  if (simd_scalar_forced()) return fade_evidence_scalar(lanes, planes, added, max_evidence);
  HWY_DYNAMIC_DISPATCH(fade_evidence)(lanes, planes, added, max_evidence);
}

}  // namespace felt
#endif
