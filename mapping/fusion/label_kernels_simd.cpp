#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapping/fusion/label_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cstring>

#include "core/simd.h"
#include "mapping/fusion/label_kernels.h"

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

void select_band(const BlockObservation& observation, float band_m, BandVoxels& band) {
  const int lanes = int(hn::Lanes(kF));
  const auto limit = hn::Set(kF, band_m);
  band.groups = 0, band.bits = {};
  int count = 0;
  for (uint32_t rest = observation.groups; rest != 0; rest &= rest - 1) {
    const int group = __builtin_ctz(rest), first = group * kGroupVoxels;
    const int before = count;
    for (int i = first; i < first + kGroupVoxels; i += lanes) {
      const FloatMask near =
          hn::And(mask_of(bits_at(observation.valid, i)), hn::Lt(hn::Abs(hn::Load(kF, observation.sdf_m + i)), limit));
      const unsigned bits = bits_of(near);
      if (bits == 0) continue;
      put_bits(bits, band.bits.row, i);
      const auto mask = hn::RebindMask(kI, near);
      // A whole vector is written; what is behind the last entry does not matter.
      hn::StoreU(hn::Compress(hn::Iota(kI, i), mask), kI, band.lane + count);
      hn::StoreU(hn::Compress(hn::Load(kI, observation.pixel + i), mask), kI, band.pixel + count);
      count += __builtin_popcount(bits);
    }
    band.groups |= uint32_t(count != before) << group;
  }
  band.count = count;
}

void fade_evidence(const LaneBits& lanes_in, std::span<Plane* const> planes, const float* added, float max_evidence) {
  const int lanes = int(hn::Lanes(kF));
  const auto most = hn::Set(kF, max_evidence), zero = hn::Zero(kF);
  for (int i = 0; i < kBlockVoxels; i += lanes) {
    const unsigned bits = bits_at(lanes_in.row, i);
    if (bits == 0) continue;
    const auto room = hn::Max(zero, hn::Sub(most, hn::Load(kF, added + i)));
    auto total = zero;
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

/// The pixels to whom a rank names a class.
HWY_INLINE FloatMask names(const SoftRank& rank, int i, int32_t nobody) {
  return hn::And(hn::Gt(hn::Load(kF, rank.amount + i), hn::Zero(kF)),
                 hn::RebindMask(kF, hn::Ne(hn::Load(kI, rank.slot + i), hn::Set(kI, nobody))));
}

void weigh_probabilities(SoftPixels& pixels) {
  const int lanes = int(hn::Lanes(kF));
  const auto zero = hn::Zero(kF), one = hn::Set(kF, 1.0f);
  const auto none = hn::Set(kI, pixels.classes);
  const auto classes = hn::Set(kF, float(pixels.classes)), evidence = hn::Set(kF, pixels.evidence);
  const auto most = hn::Set(kF, kMostProbability);
  const auto whole = hn::Set(kF, 1 - rounded_mass(int(pixels.ranks.size())));
  const FloatMask nowhere = hn::Lt(zero, zero);
  pixels.taken = pixels.invalid = 0;
  pixels.any_left = false;
  for (SoftRank& rank : pixels.ranks)  // so that the last vector adds nothing for pixels that are not there
    for (int i = pixels.count; i < pixels.count + lanes; ++i) rank.slot[i] = pixels.classes, rank.amount[i] = 0;
  for (int i = 0; i < pixels.count; i += lanes) {
    auto sum = zero, named = zero;
    FloatMask valid = hn::Not(nowhere);
    for (const SoftRank& rank : pixels.ranks) {
      const auto p = hn::Load(kF, rank.amount + i);
      valid = hn::And(valid, hn::Ge(p, zero));  // neither negative nor not a number
      sum = hn::Add(sum, hn::IfThenElseZero(hn::Gt(p, zero), p));
      named = hn::Add(named, hn::IfThenElseZero(names(rank, i, pixels.classes), one));
    }
    valid = hn::And(valid, hn::Le(sum, most));
    const FloatMask take = hn::And(valid, hn::Gt(named, zero));
    auto even = zero, share = zero;  // of the unnamed: of all together if each had as much, and of each
    FloatMask left = nowhere;
    if (pixels.spread) {
      const auto dropped = hn::IfThenElseZero(hn::Lt(sum, whole), hn::Sub(one, sum));
      const auto others = hn::Sub(classes, named);
      const FloatMask spread = hn::Gt(dropped, zero), shared = hn::And(spread, hn::Gt(others, zero));
      share = hn::IfThenElseZero(shared, hn::Div(dropped, hn::IfThenElse(shared, others, one)));
      even = hn::IfThenElse(shared, hn::Mul(share, classes), dropped);
      for (size_t r = 0; r < pixels.ranks.size(); ++r) {
        const SoftRank& rank = pixels.ranks[r];
        const auto slot = hn::Load(kI, rank.slot + i);
        FloatMask special = hn::Lt(hn::Load(kF, rank.amount + i), share);
        for (size_t before = 0; before < r; ++before)
          special =
              hn::Or(special, hn::And(hn::Gt(hn::Load(kF, pixels.ranks[before].amount + i), zero),
                                      hn::RebindMask(kF, hn::Eq(hn::Load(kI, pixels.ranks[before].slot + i), slot))));
        left = hn::Or(left, hn::And(names(rank, i, pixels.classes), special));
      }
      left = hn::And(left, hn::And(take, spread));
    }
    const FloatMask adds = hn::AndNot(left, take);
    even = hn::IfThenElseZero(adds, even);
    auto added = even;
    for (SoftRank& rank : pixels.ranks) {
      const FloatMask takes = hn::And(adds, names(rank, i, pixels.classes));
      const auto own = hn::IfThenElseZero(takes, hn::Sub(hn::Load(kF, rank.amount + i), share));
      added = hn::Add(added, own);
      hn::Store(hn::IfThenElse(hn::RebindMask(kI, takes), hn::Load(kI, rank.slot + i), none), kI, rank.slot + i);
      hn::Store(hn::Mul(evidence, own), kF, rank.amount + i);
    }
    hn::Store(hn::Mul(evidence, even), kF, pixels.even + i);
    hn::Store(hn::Mul(evidence, added), kF, pixels.added + i);
    hn::Store(hn::IfThenElse(hn::RebindMask(kI, left), hn::Set(kI, SoftPixels::kLeft),
                             hn::IfThenElseZero(hn::RebindMask(kI, adds), hn::Set(kI, SoftPixels::kAdds))),
              kI, pixels.verdict + i);
    pixels.taken += int(hn::CountTrue(kF, adds));
    pixels.invalid += int(hn::CountTrue(kF, hn::Not(valid)));
    pixels.any_left = pixels.any_left || !hn::AllFalse(kF, left);
  }
}

}  // namespace felt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {

HWY_EXPORT(select_band);
HWY_EXPORT(fade_evidence);
HWY_EXPORT(weigh_probabilities);

void select_band(const BlockObservation& observation, float band_m, BandVoxels& band) noexcept {
  if (simd_scalar_forced()) return select_band_scalar(observation, band_m, band);
  HWY_DYNAMIC_DISPATCH(select_band)(observation, band_m, band);
}

void fade_evidence(const LaneBits& lanes, std::span<Plane* const> planes, const float added[kBlockVoxels],
                   float max_evidence) noexcept {
  if (simd_scalar_forced()) return fade_evidence_scalar(lanes, planes, added, max_evidence);
  HWY_DYNAMIC_DISPATCH(fade_evidence)(lanes, planes, added, max_evidence);
}

void weigh_probabilities(SoftPixels& pixels) noexcept {
  if (simd_scalar_forced()) return weigh_probabilities_scalar(pixels);
  HWY_DYNAMIC_DISPATCH(weigh_probabilities)(pixels);
}

}  // namespace felt
#endif
