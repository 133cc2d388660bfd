#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapping/fusion/survey_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <atomic>

#include "core/simd.h"
#include "mapping/fusion/survey_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace felt::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::RebindToSigned<FloatTag>;
using FloatVec = hn::Vec<FloatTag>;
using FloatMask = hn::Mask<FloatTag>;
constexpr FloatTag kF;
constexpr IntTag kI;

void tile_range_row(const float* depth_m, int width, int height, int tile_row, float min_depth_m, float max_depth_m,
                    DepthRange* tiles) {
  constexpr int kTile = DepthTiles::kFinestTile, kAtOnce = 64;
  const int lanes = int(hn::Lanes(kF));
  const FloatVec low = hn::Set(kF, min_depth_m), high = hn::Set(kF, max_depth_m);
  const FloatVec infinity = hn::Inf(kF);
  const int first = tile_row * kTile;
  const bool whole = first + kTile <= height, more = first + 2 * kTile <= height;
  alignas(64) float nearest_m[kAtOnce], minus_farthest_m[kAtOnce];  // of the eight rows, column by column
  int u0 = 0;
  for (; whole && u0 + kAtOnce <= width; u0 += kAtOnce) {
    for (int u = 0; u < kAtOnce; u += lanes) {
      FloatVec nearest = infinity, minus_farthest = infinity;
// Unrolled: eight loads, each with a stride of its own, are what a processor foresees.
#pragma GCC unroll 8
      for (int v = 0; v < kTile; ++v) {
        const float* from = depth_m + size_t(first + v) * width + u0 + u;
        if (more) __builtin_prefetch(from + kTile * width);  // the next row of tiles
        const FloatVec d = hn::LoadU(kF, from);
        const FloatMask usable = hn::And(hn::Ge(d, low), hn::Le(d, high));
        nearest = hn::Min(nearest, hn::IfThenElse(usable, d, infinity));
        minus_farthest = hn::Min(minus_farthest, hn::IfThenElse(usable, hn::Neg(d), infinity));
      }
      hn::Store(nearest, kF, nearest_m + u);
      hn::Store(minus_farthest, kF, minus_farthest_m + u);
    }
    for (int tile = 0; tile < kAtOnce; tile += kTile) {
      const hn::CappedTag<float, 4> four;
      auto nearest = hn::Inf(four), minus_farthest = nearest;
      for (int u = tile; u < tile + kTile; u += int(hn::Lanes(four))) {
        nearest = hn::Min(nearest, hn::Load(four, nearest_m + u));
        minus_farthest = hn::Min(minus_farthest, hn::Load(four, minus_farthest_m + u));
      }
      tiles[(u0 + tile) / kTile] = {hn::GetLane(hn::MinOfLanes(four, nearest)),
                                    hn::GetLane(hn::MinOfLanes(four, minus_farthest))};
    }
  }
  for (; u0 < width; u0 += kTile)
    tiles[u0 / kTile] = tile_range(depth_m, width, height, tile_row, u0 / kTile, min_depth_m, max_depth_m);
}

void spread_range_row(const DepthRange* tiles, int stride, DepthRange* out, int count) {
  const int lanes = int(hn::Lanes(kF)), at_once = lanes / 2;
  int i = 0;
  for (; at_once > 0 && i + at_once <= count; i += at_once) {
    FloatVec least = hn::Inf(kF);
    for (int row = 0; row < 3; ++row)
      for (int column = 0; column < 3; ++column)
        least = hn::Min(least, hn::LoadU(kF, &tiles[row * stride + i + column].nearest_m));
    hn::StoreU(least, kF, &out[i].nearest_m);
  }
  spread_range_row_scalar(tiles + i, stride, out + i, count - i);
}

void mark_cells(const AllocationView& view, int v, RowSamples& row, uint8_t* cells) {
  const int lanes = int(hn::Lanes(kF));
  const FloatVec zero = hn::Zero(kF);
  FloatVec row_direction[3], ray_u[3], origin[3], extent[3];
  for (int c = 0; c < 3; ++c) {
    row_direction[c] = hn::Set(kF, view.ray0[c] + float(v) * view.ray_v[c]);
    ray_u[c] = hn::Set(kF, view.ray_u[c]);
    origin[c] = hn::Set(kF, view.origin[c]);
    extent[c] = hn::Set(kF, float(view.cells[c]));
  }
  const auto cells_y = hn::Set(kI, view.cells[1]), cells_z = hn::Set(kI, view.cells[2]);
  const auto spare = hn::Set(kI, view.cells[0] * view.cells[1] * view.cells[2]);
  // What fills the last vector repeats a pixel.
  for (int i = row.count; i % lanes != 0; ++i) row.u[i] = row.u[0], row.depth_m[i] = row.depth_m[0];
  alignas(64) int32_t index[16];
  for (int i = 0; i < row.count; i += lanes) {
    const FloatVec d = hn::Load(kF, row.depth_m + i), u = hn::Load(kF, row.u + i);
    FloatVec direction[3];
    for (int c = 0; c < 3; ++c) direction[c] = hn::Add(row_direction[c], hn::Mul(u, ray_u[c]));
    for (int s = 0; s < view.samples; ++s) {
      const FloatVec along = hn::Add(d, hn::Set(kF, view.offsets_m[s]));
      FloatVec q[3];
      for (int c = 0; c < 3; ++c) q[c] = hn::Add(origin[c], hn::Mul(along, direction[c]));
      const auto within = [&](int c) { return hn::And(hn::Ge(q[c], zero), hn::Lt(q[c], extent[c])); };
      const FloatMask inside = hn::And(within(0), hn::And(within(1), within(2)));
      const auto slab = hn::Add(hn::Mul(hn::ConvertTo(kI, q[0]), cells_y), hn::ConvertTo(kI, q[1]));
      const auto cell = hn::Add(hn::Mul(slab, cells_z), hn::ConvertTo(kI, q[2]));
      hn::Store(hn::IfThenElse(hn::RebindMask(kI, inside), cell, spare), kI, index);
      for (int lane = 0; lane < lanes; ++lane)
        std::atomic_ref<uint8_t>(cells[index[lane]]).store(1, std::memory_order_relaxed);
    }
  }
}

}  // namespace felt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {

HWY_EXPORT(tile_range_row);
HWY_EXPORT(spread_range_row);
HWY_EXPORT(mark_cells);

void tile_range_row(const float* depth_m, int width, int height, int tile_row, float min_depth_m, float max_depth_m,
                    DepthRange* tiles) noexcept {
  if (simd_scalar_forced())
    return tile_range_row_scalar(depth_m, width, height, tile_row, min_depth_m, max_depth_m, tiles);
  HWY_DYNAMIC_DISPATCH(tile_range_row)(depth_m, width, height, tile_row, min_depth_m, max_depth_m, tiles);
}

void spread_range_row(const DepthRange* tiles, int stride, DepthRange* out, int count) noexcept {
  if (simd_scalar_forced()) return spread_range_row_scalar(tiles, stride, out, count);
  HWY_DYNAMIC_DISPATCH(spread_range_row)(tiles, stride, out, count);
}

void mark_cells(const AllocationView& view, int v, RowSamples& row, uint8_t* cells) noexcept {
  if (simd_scalar_forced()) return mark_cells_scalar(view, v, row, cells);
  HWY_DYNAMIC_DISPATCH(mark_cells)(view, v, row, cells);
}

}  // namespace felt
#endif
