#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapping/fusion/tsdf_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <cstring>

#include "core/simd.h"
#include "mapping/fusion/tsdf_kernels.h"

#ifndef FELTMAP_FETCH_PIXELS
#define FELTMAP_FETCH_PIXELS
namespace felt {
namespace {

// Plain loads: x86 gather instructions take 2 to 4 times as long where microcode guards them against data sampling.
// Compiled for the baseline target, so that no compiler turns the loops into gathers.
template <typename T>
[[gnu::noinline]] void fetch_pixels(const T* image, const int32_t* pixel, uint32_t groups, T* out) {
  for (; groups != 0; groups &= groups - 1) {
    const int first = __builtin_ctz(groups) * kGroupVoxels;
    for (int i = first; i < first + kGroupVoxels; ++i) out[i] = image[uint32_t(pixel[i])];
  }
}

// As the pairs of floats that they are: eight bytes a load.
[[gnu::noinline]] void fetch_ranges(const DepthRange* ranges, const int32_t* tile, int count, DepthRange* out) {
  for (int i = 0; i < count; ++i) std::memcpy(out + i, ranges + uint32_t(tile[i]), sizeof *out);
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

uint64_t cubes_in_band(const BlockCoord& block, const DepthView& view) {
  float base[3];
  block_base(block, view, base);
  const DepthTiles::Level* level = tiles_for(view, base[2] + view.nearest_cube_m - view.reach_m);
  if (level == nullptr) return kAllCubes;
  const int lanes = int(hn::Lanes(kF));
  const auto tile_px = float(level->tile_px);
  const FloatVec zero = hn::Zero(kF), one = hn::Set(kF, 1.0f);
  const FloatVec tile = hn::Set(kF, tile_px), inverse_tile = hn::Set(kF, 1.0f / tile_px);
  const FloatVec right = hn::Set(kF, float(view.width) + 2 * tile_px);
  const FloatVec bottom = hn::Set(kF, float(view.height) + 2 * tile_px);
  const FloatVec hu0 = hn::Set(kF, base[0]), hv0 = hn::Set(kF, base[1]), z0 = hn::Set(kF, base[2]);
  const FloatVec band = hn::Set(kF, view.band_m);
  const auto columns = hn::Set(kI, level->around_stride());
  alignas(64) float depth_m[64];
  alignas(64) int32_t index[64];
  alignas(64) DepthRange ranges[64];
  alignas(64) int32_t pixels[64];
  const auto row_length = hn::Set(kI, view.width);
  uint8_t inside_bits[8 + 8], band_bits[8 + 8];  // eight bytes more because some targets write that many
  for (int i = 0; i < 64; i += lanes) {
    const FloatVec z = hn::Add(z0, hn::Load(kF, view.cube[2] + i));
    const FloatVec inverse_z = hn::Div(one, z);
    const FloatVec u = hn::Add(hn::Mul(hn::Add(hu0, hn::Load(kF, view.cube[0] + i)), inverse_z), tile);
    const FloatVec v = hn::Add(hn::Mul(hn::Add(hv0, hn::Load(kF, view.cube[1] + i)), inverse_z), tile);
    const FloatMask inside =
        hn::And(hn::And(hn::Ge(u, zero), hn::Ge(v, zero)), hn::And(hn::Lt(u, right), hn::Lt(v, bottom)));
    const auto at = hn::Add(hn::Mul(hn::ConvertTo(kI, hn::Mul(v, inverse_tile)), columns),
                            hn::ConvertTo(kI, hn::Mul(u, inverse_tile)));
    hn::Store(hn::IfThenElseZero(hn::RebindMask(kI, inside), at), kI, index + i);
    hn::Store(hn::Add(hn::Mul(hn::ConvertTo(kI, hn::Sub(v, tile)), row_length), hn::ConvertTo(kI, hn::Sub(u, tile))),
              kI, pixels + i);
    hn::Store(z, kF, depth_m + i);
    store_bits(inside, i, inside_bits);
  }
  fetch_ranges(level->around.data(), index, 64, ranges);
  for (int i = 0; i < 64; i += lanes) {
    FloatVec nearest, minus_farthest;
    hn::LoadInterleaved2(kF, &ranges[i].nearest_m, nearest, minus_farthest);
    const FloatVec z = hn::Load(kF, depth_m + i);
    FloatMask near = hn::Lt(hn::Add(minus_farthest, z), band);
    if (!view.carve) near = hn::And(near, hn::Lt(hn::Sub(nearest, z), band));
    store_bits(hn::And(near, load_bits(inside_bits, i)), i, band_bits);
  }
  uint64_t cubes;
  std::memcpy(&cubes, band_bits, sizeof cubes);
  // The depth that these cubes' voxels will read travels meanwhile: two rows of the image, above and below the centre.
  const int half_px = int(0.5f * view.reach_px_m / (base[2] + view.cube[2][32]));
  for (uint64_t rest = cubes; rest != 0; rest &= rest - 1) {
    const intptr_t pixel = pixels[__builtin_ctzll(rest)];
    for (const intptr_t at : {pixel - half_px * view.width, pixel + half_px * view.width})
      __builtin_prefetch(reinterpret_cast<const void*>(reinterpret_cast<intptr_t>(view.depth_m) + 4 * at), 0, 3);
  }
  return cubes;
}

enum class Factor { none, ray, image };  ///< of d - z

template <Factor kFactor, WeightModel kModel>
bool observe(const BlockCoord& block, const DepthView& view, BlockObservation& out, uint64_t cubes) {
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
  const FloatVec centre_u = hn::Set(kF, view.centre[0]), inverse_fx = hn::Set(kF, view.inverse_focal[0]);
  const FloatVec centre_v = hn::Set(kF, view.centre[1]), inverse_fy = hn::Set(kF, view.inverse_focal[1]);
  const FloatVec dropoff_start = hn::Set(kF, -view.dropoff_start_m), dropoff_slope = hn::Set(kF, view.dropoff_slope);
  std::memset(out.valid, 0, sizeof out.valid);
  out.groups = 0;
  // Where each voxel falls. Voxels outside the image take pixel 0, so that reading depth needs no test.
  uint32_t in_view = 0;
  for (uint32_t rest = groups_of_cubes(cubes); rest != 0; rest &= rest - 1) {
    const int group = __builtin_ctz(rest), x = group >> 2;
    const FloatVec hu0 = hn::Set(kF, base[0] + float(x) * view.step_x[0]);
    const FloatVec hv0 = hn::Set(kF, base[1] + float(x) * view.step_x[1]);
    const FloatVec z0 = hn::Set(kF, base[2] + float(x) * view.step_x[2]);
    bool any = false;
    for (int i = group * kGroupVoxels; i < (group + 1) * kGroupVoxels; i += lanes) {
      const int lane = i & 63;
      const FloatVec z = hn::Add(z0, hn::Load(kF, view.plane[2] + lane));
      const FloatVec inverse_z = hn::Div(one, z);
      const FloatVec u = hn::Mul(hn::Add(hu0, hn::Load(kF, view.plane[0] + lane)), inverse_z);
      const FloatVec v = hn::Mul(hn::Add(hv0, hn::Load(kF, view.plane[1] + lane)), inverse_z);
      const FloatMask inside = hn::And(hn::And(hn::Gt(z, zero), hn::And(hn::Ge(u, zero), hn::Ge(v, zero))),
                                       hn::And(hn::Lt(u, width), hn::Lt(v, height)));
      const auto index = hn::Add(hn::Mul(hn::ConvertTo(kI, v), row_length), hn::ConvertTo(kI, u));
      any = any || !hn::AllFalse(kF, inside);
      store_bits(inside, i, out.valid);
      hn::Store(z, kF, out.sdf_m + i);
      if constexpr (kFactor == Factor::ray) {  // kept where the weight will be: it is asked for once depth is there
        const FloatVec ray_x = hn::Mul(hn::Sub(u, centre_u), inverse_fx);
        const FloatVec ray_y = hn::Mul(hn::Sub(v, centre_v), inverse_fy);
        hn::Store(hn::Sqrt(hn::Add(hn::Add(one, hn::Mul(ray_x, ray_x)), hn::Mul(ray_y, ray_y))), kF, out.weight + i);
      }
      hn::Store(hn::IfThenElseZero(hn::RebindMask(kI, inside), index), kI, out.pixel + i);
    }
    in_view |= uint32_t(any) << group;
  }
  if (in_view == 0) return false;
  alignas(64) float depth_m[kBlockVoxels];
  alignas(64) float scales[kFactor == Factor::image ? kBlockVoxels : 1];
  fetch_pixels(view.depth_m, out.pixel, in_view, depth_m);
  if constexpr (kFactor == Factor::image) fetch_pixels(view.scale, out.pixel, in_view, scales);

  for (uint32_t rest = in_view; rest != 0; rest &= rest - 1) {
    const int group = __builtin_ctz(rest);
    bool any = false;
    for (int i = group * kGroupVoxels; i < (group + 1) * kGroupVoxels; i += lanes) {
      const FloatVec d = hn::Load(kF, depth_m + i);
      FloatVec sdf = hn::Sub(d, hn::Load(kF, out.sdf_m + i));
      FloatMask valid = hn::And(load_bits(out.valid, i), hn::And(hn::Ge(d, nearest), hn::Le(d, farthest)));
      if constexpr (kFactor == Factor::ray) sdf = hn::Mul(sdf, hn::Load(kF, out.weight + i));
      if constexpr (kFactor == Factor::image) {
        const FloatVec scale = hn::Load(kF, scales + i);
        valid = hn::And(valid, hn::Gt(scale, zero));
        sdf = hn::Mul(sdf, scale);
      }
      valid = hn::And(valid, hn::And(hn::Gt(sdf, minus_truncation), hn::Lt(sdf, sdf_limit)));
      store_bits(valid, i, out.valid);
      any = any || !hn::AllFalse(kF, valid);
      FloatVec weight = observation_weight<kModel>(d);
      const FloatVec falling = hn::Mul(weight, hn::Mul(hn::Add(sdf, truncation), dropoff_slope));
      weight = hn::IfThenElse(hn::Lt(sdf, dropoff_start), falling, weight);
      hn::Store(hn::Min(sdf, truncation), kF, out.sdf_m + i);
      hn::Store(weight, kF, out.weight + i);
    }
    out.groups |= uint32_t(any) << group;
  }
  return out.groups != 0;
}

template <Factor kFactor>
bool observe_weighted(const BlockCoord& block, const DepthView& view, BlockObservation& out, uint64_t cubes) {
  switch (view.weight) {
    case WeightModel::inverse_square:
      return observe<kFactor, WeightModel::inverse_square>(block, view, out, cubes);
    case WeightModel::sensor_noise:
      return observe<kFactor, WeightModel::sensor_noise>(block, view, out, cubes);
    default:
      return observe<kFactor, WeightModel::constant>(block, view, out, cubes);
  }
}

bool observe_block(const BlockCoord& block, const DepthView& view, BlockObservation& out, uint64_t cubes) {
  if (view.scale != nullptr) return observe_weighted<Factor::image>(block, view, out, cubes);
  return view.along_ray ? observe_weighted<Factor::ray>(block, view, out, cubes)
                        : observe_weighted<Factor::none>(block, view, out, cubes);
}

void fuse_tsdf(const BlockObservation& observation, float max_weight, GeometryPlanes& planes) {
  const FloatVec cap = hn::Set(kF, max_weight);
  for (uint32_t rest = observation.groups; rest != 0; rest &= rest - 1) {
    const int first = __builtin_ctz(rest) * kGroupVoxels;
    for (int i = first; i < first + kGroupVoxels; i += int(hn::Lanes(kF))) {
      const FloatMask valid = load_bits(observation.valid, i);
      const FloatVec W = hn::Load(kF, planes.weight + i), w = hn::Load(kF, observation.weight + i);
      const FloatVec sum = hn::Add(W, w), old = hn::Load(kF, planes.tsdf + i);
      const FloatVec fresh = hn::Div(hn::Add(hn::Mul(old, W), hn::Mul(hn::Load(kF, observation.sdf_m + i), w)), sum);
      hn::Store(hn::IfThenElse(valid, fresh, old), kF, planes.tsdf + i);
      hn::Store(hn::IfThenElse(valid, hn::Min(sum, cap), W), kF, planes.weight + i);
    }
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
  uint32_t groups = 0;  // with a voxel in the band
  for (uint32_t rest = observation.groups; rest != 0; rest &= rest - 1) {
    const int group = __builtin_ctz(rest);
    bool any = false;
    for (int i = group * kGroupVoxels; i < (group + 1) * kGroupVoxels; i += lanes)
      any = any || !hn::AllFalse(kF, hn::And(load_bits(observation.valid, i),
                                             hn::Lt(hn::Abs(hn::Load(kF, observation.sdf_m + i)), band)));
    groups |= uint32_t(any) << group;
  }
  // First fetch, then average: a vector load right behind the stores it depends on would stall.
  alignas(64) int32_t pixels[kBlockVoxels];
  fetch_pixels(reinterpret_cast<const int32_t*>(rgba), observation.pixel, groups, pixels);
  for (uint32_t rest = groups; rest != 0; rest &= rest - 1) {
    const int first = __builtin_ctz(rest) * kGroupVoxels;
    for (int i = first; i < first + kGroupVoxels; i += lanes) {
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

HWY_EXPORT(cubes_in_band);
HWY_EXPORT(observe_block);
HWY_EXPORT(fuse_tsdf);
HWY_EXPORT(fuse_color);
HWY_EXPORT(tangent_scale_row);

uint64_t cubes_in_band(const BlockCoord& block, const DepthView& view) noexcept {
  return simd_scalar_forced() ? cubes_in_band_scalar(block, view) : HWY_DYNAMIC_DISPATCH(cubes_in_band)(block, view);
}

bool observe_block(const BlockCoord& block, const DepthView& view, BlockObservation& out, uint64_t cubes) noexcept {
  return simd_scalar_forced() ? observe_block_scalar(block, view, out, cubes)
                              : HWY_DYNAMIC_DISPATCH(observe_block)(block, view, out, cubes);
}

void fuse_tsdf(const BlockObservation& observation, float max_weight, GeometryPlanes& planes) noexcept {
  if (simd_scalar_forced()) return fuse_tsdf_scalar(observation, max_weight, planes);
  HWY_DYNAMIC_DISPATCH(fuse_tsdf)(observation, max_weight, planes);
}

void fuse_color(const BlockObservation& observation, const uint32_t* rgba, float band_m, ColorPlanes& planes) noexcept {
  if (simd_scalar_forced()) return fuse_color_scalar(observation, rgba, band_m, planes);
  HWY_DYNAMIC_DISPATCH(fuse_color)(observation, rgba, band_m, planes);
}

void tangent_scale_row(const SlopeView& view, int v, float* scale_row) noexcept {
  constexpr int kWidestVector = 16;
  if (simd_scalar_forced() || view.width < kWidestVector + 2) return tangent_scale_row_scalar(view, v, scale_row);
  HWY_DYNAMIC_DISPATCH(tangent_scale_row)(view, v, scale_row);
}

}  // namespace felt
#endif
