#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapping/tsdf_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <atomic>
#include <cstring>

#include "core/simd.h"
#include "mapping/tsdf_kernels.h"

#ifndef FELTMAP_FETCH_PIXELS
#define FELTMAP_FETCH_PIXELS
namespace felt {
namespace {

// Plain loads: x86 gather instructions take 2 to 4 times as long where microcode guards them against data sampling.
// Compiled for the baseline target, so that no compiler turns the loop into a gather.
template <typename T>
[[gnu::noinline]] void fetch_pixels(const T* image, const int32_t* pixel, int count, T* out) {
  for (int i = 0; i < count; ++i) out[i] = image[uint32_t(pixel[i])];
}

}  // namespace
}  // namespace felt
#endif

HWY_BEFORE_NAMESPACE();
namespace felt::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A vector is at most two rows of a block (16 floats), so that row masks and slab tables fit every target.
using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::RebindToSigned<FloatTag>;
using U16Tag = hn::Rebind<uint16_t, FloatTag>;
using FloatVec = hn::Vec<FloatTag>;
using FloatMask = hn::Mask<FloatTag>;
constexpr FloatTag kF;
constexpr IntTag kI;
constexpr U16Tag kU16;

/// Sets the bits of lanes [i, i + N) of a block: whole bytes, or a part of one where vectors are shorter than a row.
HWY_INLINE void store_bits(FloatMask mask, int i, uint8_t* valid) {
  uint8_t bits[8] = {};
  hn::StoreMaskBits(kF, mask, bits);
  const int lanes = int(hn::Lanes(kF));
  if (lanes >= 8) {
    std::memcpy(valid + i / 8, bits, size_t(lanes) / 8);
  } else {
    const int others = ~(((1 << lanes) - 1) << (i & 7));
    valid[i / 8] = uint8_t((valid[i / 8] & others) | bits[0] << (i & 7));
  }
}

HWY_INLINE FloatMask load_bits(const uint8_t* valid, int i) {
  uint8_t bits[8] = {};  // eight bytes because some targets read that many
  const int lanes = int(hn::Lanes(kF));
  if (lanes >= 8) {
    std::memcpy(bits, valid + i / 8, size_t(lanes) / 8);
  } else {
    bits[0] = uint8_t(valid[i / 8] >> (i & 7) & ((1 << lanes) - 1));
  }
  return hn::LoadMaskBits(kF, bits);
}

HWY_INLINE bool any_bits(const uint8_t* valid, int i) {
  if (hn::Lanes(kF) == 16) {
    uint16_t two;
    std::memcpy(&two, valid + i / 8, 2);
    return two != 0;
  }
  return valid[i / 8] != 0;
}

template <WeightModel kModel>
HWY_INLINE FloatVec observation_weight(FloatVec d) {
  const FloatVec one = hn::Set(kF, 1.0f);
  if constexpr (kModel == WeightModel::inverse_square) return hn::Div(one, hn::Mul(d, d));
  if constexpr (kModel == WeightModel::sensor_noise) {
    const FloatVec off = hn::Sub(d, hn::Set(kF, SensorNoise::kOffset));
    const FloatVec sigma =
        hn::Add(hn::Set(kF, SensorNoise::kFloor), hn::Mul(hn::Set(kF, SensorNoise::kGrowth), hn::Mul(off, off)));
    const FloatVec ratio = hn::Div(hn::Set(kF, SensorNoise::kSigmaAtOneMetre), sigma);
    return hn::Mul(ratio, ratio);
  }
  return one;
}

template <bool kScaled, WeightModel kModel>
bool observe(const BlockCoord& block, const DepthView& view, BlockObservation& out) {
  float base[3];
  block_base(block, view, base);
  const int lanes = int(hn::Lanes(kF));
  const FloatVec zero = hn::Zero(kF), one = hn::Set(kF, 1.0f);
  const FloatVec width = hn::Set(kF, float(view.width)), height = hn::Set(kF, float(view.height));
  const auto row_length = hn::Set(kI, view.width);
  const FloatVec nearest = hn::Set(kF, view.min_depth_m), farthest = hn::Set(kF, view.max_depth_m);
  const FloatVec truncation = hn::Set(kF, view.truncation_m), minus_truncation = hn::Set(kF, -view.truncation_m);
  // Carving takes free space at any distance in front.
  const FloatVec sdf_limit = hn::Set(kF, view.carve ? HWY_MAX(view.max_depth_m, 1.0f) * 1e6f : view.truncation_m);
  const FloatVec dropoff_start = hn::Set(kF, -view.dropoff_start_m), dropoff_slope = hn::Set(kF, view.dropoff_slope);
  // Where each voxel falls. Voxels outside the image take pixel 0, so that reading depth needs no test.
  bool in_view = false;
  std::memset(out.valid, 0, sizeof out.valid);
  for (int x = 0; x < 8; ++x) {
    const FloatVec hu0 = hn::Set(kF, base[0] + float(x) * view.step_x[0]);
    const FloatVec hv0 = hn::Set(kF, base[1] + float(x) * view.step_x[1]);
    const FloatVec z0 = hn::Set(kF, base[2] + float(x) * view.step_x[2]);
    for (int lane = 0; lane < 64; lane += lanes) {
      const int i = x * 64 + lane;
      const FloatVec z = hn::Add(z0, hn::Load(kF, view.plane[2] + lane));
      const FloatVec inverse_z = hn::Div(one, z);
      const FloatVec u = hn::Mul(hn::Add(hu0, hn::Load(kF, view.plane[0] + lane)), inverse_z);
      const FloatVec v = hn::Mul(hn::Add(hv0, hn::Load(kF, view.plane[1] + lane)), inverse_z);
      const FloatMask inside = hn::And(hn::And(hn::Gt(z, zero), hn::And(hn::Ge(u, zero), hn::Ge(v, zero))),
                                       hn::And(hn::Lt(u, width), hn::Lt(v, height)));
      const auto index = hn::Add(hn::Mul(hn::ConvertTo(kI, v), row_length), hn::ConvertTo(kI, u));
      in_view = in_view || !hn::AllFalse(kF, inside);
      store_bits(inside, i, out.valid);
      hn::Store(z, kF, out.sdf_m + i);
      hn::Store(hn::IfThenElseZero(hn::RebindMask(kI, inside), index), kI, out.pixel + i);
    }
  }
  if (!in_view) return false;
  alignas(64) float depth_m[kBlockVoxels];
  alignas(64) float scales[kScaled ? kBlockVoxels : 1];
  fetch_pixels(view.depth_m, out.pixel, kBlockVoxels, depth_m);
  if constexpr (kScaled) fetch_pixels(view.scale, out.pixel, kBlockVoxels, scales);

  bool any = false;
  for (int i = 0; i < kBlockVoxels; i += lanes) {
    const FloatVec d = hn::Load(kF, depth_m + i);
    FloatVec sdf = hn::Sub(d, hn::Load(kF, out.sdf_m + i));
    FloatMask valid = hn::And(load_bits(out.valid, i), hn::And(hn::Ge(d, nearest), hn::Le(d, farthest)));
    if constexpr (kScaled) {
      const FloatVec scale = hn::Load(kF, scales + i);
      valid = hn::And(valid, hn::Gt(scale, zero));
      sdf = hn::Mul(sdf, scale);
    }
    valid = hn::And(valid, hn::And(hn::Gt(sdf, minus_truncation), hn::Lt(sdf, sdf_limit)));
    store_bits(valid, i, out.valid);
    if (hn::AllFalse(kF, valid)) continue;
    any = true;
    FloatVec weight = observation_weight<kModel>(d);
    const FloatVec falling = hn::Mul(weight, hn::Mul(hn::Add(sdf, truncation), dropoff_slope));
    weight = hn::IfThenElse(hn::Lt(sdf, dropoff_start), falling, weight);
    hn::Store(hn::Min(sdf, truncation), kF, out.sdf_m + i);
    hn::Store(weight, kF, out.weight + i);
  }
  return any;
}

template <bool kScaled>
bool observe_weighted(const BlockCoord& block, const DepthView& view, BlockObservation& out) {
  switch (view.weight) {
    case WeightModel::inverse_square:
      return observe<kScaled, WeightModel::inverse_square>(block, view, out);
    case WeightModel::sensor_noise:
      return observe<kScaled, WeightModel::sensor_noise>(block, view, out);
    default:
      return observe<kScaled, WeightModel::constant>(block, view, out);
  }
}

bool observe_block(const BlockCoord& block, const DepthView& view, BlockObservation& out) {
  return view.scale != nullptr ? observe_weighted<true>(block, view, out) : observe_weighted<false>(block, view, out);
}

void fuse_tsdf(const BlockObservation& observation, float max_weight, GeometryPlanes& planes) {
  const FloatVec cap = hn::Set(kF, max_weight);
  for (int i = 0; i < kBlockVoxels; i += int(hn::Lanes(kF))) {
    if (!any_bits(observation.valid, i)) continue;
    const FloatMask valid = load_bits(observation.valid, i);
    const FloatVec W = hn::Load(kF, planes.weight + i), w = hn::Load(kF, observation.weight + i);
    const FloatVec sum = hn::Add(W, w), old = hn::Load(kF, planes.tsdf + i);
    const FloatVec fresh = hn::Div(hn::Add(hn::Mul(old, W), hn::Mul(hn::Load(kF, observation.sdf_m + i), w)), sum);
    hn::Store(hn::IfThenElse(valid, fresh, old), kF, planes.tsdf + i);
    hn::Store(hn::IfThenElse(valid, hn::Min(sum, cap), W), kF, planes.weight + i);
  }
}

HWY_INLINE void average_color(FloatMask take, FloatVec byte, FloatVec share, uint16_t* stored) {
  const auto old_bits = hn::Load(kU16, stored);
  const FloatVec old = hn::ConvertTo(kF, hn::PromoteTo(kI, old_bits));
  const FloatVec fresh = hn::Add(old, hn::Mul(hn::Sub(hn::Mul(byte, hn::Set(kF, 256.0f)), old), share));
  const FloatVec kept = hn::IfThenElse(take, hn::Add(fresh, hn::Set(kF, 0.5f)), old);
  hn::Store(hn::DemoteTo(kU16, hn::ConvertTo(kI, kept)), kU16, stored);
}

void fuse_color(const BlockObservation& observation, const uint32_t* rgba, float band_m, ColorPlanes& planes) {
  const FloatVec band = hn::Set(kF, band_m), one = hn::Set(kF, 1.0f), top = hn::Set(kF, float(kMaxColorCount));
  const auto byte_mask = hn::Set(kI, 0xff);
  const int lanes = int(hn::Lanes(kF));
  // First fetch, then average: a vector load right behind the stores it depends on would stall.
  alignas(64) int32_t pixels[kBlockVoxels];
  int todo[kBlockVoxels], count_todo = 0;
  for (int i = 0; i < kBlockVoxels; i += lanes) {
    if (!any_bits(observation.valid, i)) continue;
    fetch_pixels(reinterpret_cast<const int32_t*>(rgba), observation.pixel + i, lanes, pixels + i);
    todo[count_todo++] = i;
  }
  for (int n = 0; n < count_todo; ++n) {
    const int i = todo[n];
    const auto pixel = hn::Load(kI, pixels + i);
    // Alpha is the high byte; the shift keeps its sign, which does not matter for the comparison with 0.
    const FloatMask colored = hn::RebindMask(kF, hn::Ne(hn::ShiftRight<24>(pixel), hn::Zero(kI)));
    const FloatMask near = hn::Lt(hn::Abs(hn::Load(kF, observation.sdf_m + i)), band);
    const FloatMask take = hn::And(load_bits(observation.valid, i), hn::And(near, colored));
    if (hn::AllFalse(kF, take)) continue;
    const FloatVec old_count = hn::ConvertTo(kF, hn::PromoteTo(kI, hn::Load(kU16, planes.count + i)));
    const FloatVec count = hn::Min(hn::Add(old_count, one), top);
    const FloatVec share = hn::Div(one, count);
    average_color(take, hn::ConvertTo(kF, hn::And(pixel, byte_mask)), share, planes.r + i);
    average_color(take, hn::ConvertTo(kF, hn::And(hn::ShiftRight<8>(pixel), byte_mask)), share, planes.g + i);
    average_color(take, hn::ConvertTo(kF, hn::And(hn::ShiftRight<16>(pixel), byte_mask)), share, planes.b + i);
    const FloatVec kept = hn::IfThenElse(take, count, old_count);
    hn::Store(hn::DemoteTo(kU16, hn::ConvertTo(kI, kept)), kU16, planes.count + i);
  }
}

void mark_cells_in_row(const AllocationView& view, int v, uint8_t* cells) {
  const int lanes = int(hn::Lanes(kF));
  const float* row = view.depth_m + size_t(v) * view.width;
  const FloatVec zero = hn::Zero(kF);
  const FloatVec nearest = hn::Set(kF, view.min_depth_m), farthest = hn::Set(kF, view.max_depth_m);
  const auto width = hn::Set(kI, view.width);
  alignas(64) int32_t index[16];
  alignas(64) float sampled_m[16];
  for (int u0 = 0; u0 < view.width; u0 += lanes * view.stride) {
    const auto u = hn::Add(hn::Mul(hn::Iota(kI, 0), hn::Set(kI, view.stride)), hn::Set(kI, u0));
    const auto in_row = hn::RebindMask(kF, hn::Lt(u, width));
    for (int lane = 0; lane < lanes; ++lane) sampled_m[lane] = row[HWY_MIN(u0 + lane * view.stride, view.width - 1)];
    const FloatVec d = hn::Load(kF, sampled_m);
    const FloatMask usable = hn::And(in_row, hn::And(hn::Ge(d, nearest), hn::Le(d, farthest)));
    if (hn::AllFalse(kF, usable)) continue;
    const FloatVec uf = hn::ConvertTo(kF, u);
    FloatVec direction[3];
    for (int c = 0; c < 3; ++c)
      direction[c] =
          hn::Add(hn::Set(kF, view.ray0[c] + float(v) * view.ray_v[c]), hn::Mul(uf, hn::Set(kF, view.ray_u[c])));
    for (int s = 0; s < view.samples; ++s) {
      const FloatVec along = hn::Add(d, hn::Set(kF, view.offsets_m[s]));
      FloatMask inside = usable;
      auto cell = hn::Zero(kI);
      for (int c = 0; c < 3; ++c) {
        const FloatVec q = hn::Add(hn::Set(kF, view.origin[c]), hn::Mul(along, direction[c]));
        inside = hn::And(inside, hn::And(hn::Ge(q, zero), hn::Lt(q, hn::Set(kF, float(view.cells[c])))));
        cell = hn::Add(hn::Mul(cell, hn::Set(kI, view.cells[c])), hn::ConvertTo(kI, q));
      }
      hn::Store(cell, kI, index);
      uint8_t bits[8] = {};
      hn::StoreMaskBits(kF, inside, bits);
      uint32_t set = uint32_t(bits[0]) | uint32_t(bits[1]) << 8;
      for (; set != 0; set &= set - 1)
        std::atomic_ref<uint8_t>(cells[index[__builtin_ctz(set)]]).store(1, std::memory_order_relaxed);
    }
  }
}

void tangent_scale_row(const SlopeView& view, int v, float* scale_row) {
  if (v == 0 || v == view.height - 1 || view.width < 3) {
    std::fill_n(scale_row, view.width, 0.0f);
    return;
  }
  const int lanes = int(hn::Lanes(kF));
  const float* row = view.depth_m + size_t(v) * view.width;
  const FloatVec zero = hn::Zero(kF);
  const FloatVec ry = hn::Set(kF, (float(v) - view.cy) / view.fy);
  const FloatVec half_fx = hn::Set(kF, 0.5f * view.fx), half_fy = hn::Set(kF, 0.5f * view.fy);
  const FloatVec inverse_fx = hn::Set(kF, 1.0f / view.fx), cx = hn::Set(kF, view.cx);
  const FloatVec max_step = hn::Set(kF, view.max_step), farthest = hn::Set(kF, view.max_depth_m);
  const auto near_z = [&](FloatVec other, FloatVec z, FloatVec limit) {
    return hn::Le(hn::Abs(hn::Sub(other, z)), limit);
  };
  scale_row[0] = scale_row[view.width - 1] = 0;
  // The last vector overlaps its predecessor instead of leaving a tail; narrow images take the scalar path.
  for (int u = 1; u < view.width - 1;) {
    const int at = HWY_MIN(u, view.width - 1 - lanes);
    const FloatVec z = hn::LoadU(kF, row + at);
    const FloatVec left = hn::LoadU(kF, row + at - 1), right = hn::LoadU(kF, row + at + 1);
    const FloatVec up = hn::LoadU(kF, row + at - view.width), down = hn::LoadU(kF, row + at + view.width);
    const FloatVec limit = hn::Mul(max_step, z);
    const FloatMask usable = hn::And(hn::Gt(z, zero), hn::Le(z, farthest));
    const FloatMask level = hn::And(near_z(left, z, limit), near_z(right, z, limit));
    const FloatMask upright = hn::And(near_z(up, z, limit), near_z(down, z, limit));
    const FloatMask smooth = hn::And(usable, hn::And(level, upright));
    const FloatVec su = hn::Mul(half_fx, hn::Sub(right, left)), sv = hn::Mul(half_fy, hn::Sub(down, up));
    const FloatVec uf = hn::ConvertTo(kF, hn::Iota(kI, at));
    const FloatVec rx = hn::Mul(hn::Sub(uf, cx), inverse_fx);
    const FloatVec nz = hn::Add(hn::Add(z, hn::Mul(su, rx)), hn::Mul(sv, ry));
    const FloatVec length = hn::Sqrt(hn::Add(hn::Add(hn::Mul(su, su), hn::Mul(sv, sv)), hn::Mul(nz, nz)));
    hn::StoreU(hn::IfThenElseZero(smooth, hn::Div(z, length)), kF, scale_row + at);
    u = at + lanes;
  }
}

}  // namespace felt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {

HWY_EXPORT(observe_block);
HWY_EXPORT(fuse_tsdf);
HWY_EXPORT(fuse_color);
HWY_EXPORT(mark_cells_in_row);
HWY_EXPORT(tangent_scale_row);

bool observe_block(const BlockCoord& block, const DepthView& view, BlockObservation& out) noexcept {
  return simd_scalar_forced() ? observe_block_scalar(block, view, out)
                              : HWY_DYNAMIC_DISPATCH(observe_block)(block, view, out);
}

void fuse_tsdf(const BlockObservation& observation, float max_weight, GeometryPlanes& planes) noexcept {
  if (simd_scalar_forced()) return fuse_tsdf_scalar(observation, max_weight, planes);
  HWY_DYNAMIC_DISPATCH(fuse_tsdf)(observation, max_weight, planes);
}

void fuse_color(const BlockObservation& observation, const uint32_t* rgba, float band_m, ColorPlanes& planes) noexcept {
  if (simd_scalar_forced()) return fuse_color_scalar(observation, rgba, band_m, planes);
  HWY_DYNAMIC_DISPATCH(fuse_color)(observation, rgba, band_m, planes);
}

void mark_cells_in_row(const AllocationView& view, int v, uint8_t* cells) noexcept {
  if (simd_scalar_forced()) return mark_cells_in_row_scalar(view, v, cells);
  HWY_DYNAMIC_DISPATCH(mark_cells_in_row)(view, v, cells);
}

void tangent_scale_row(const SlopeView& view, int v, float* scale_row) noexcept {
  constexpr int kWidestVector = 16;
  if (simd_scalar_forced() || view.width < kWidestVector + 2) return tangent_scale_row_scalar(view, v, scale_row);
  HWY_DYNAMIC_DISPATCH(tangent_scale_row)(view, v, scale_row);
}

}  // namespace felt
#endif
