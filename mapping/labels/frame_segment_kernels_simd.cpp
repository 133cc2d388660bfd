#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "mapping/labels/frame_segment_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>

#include "core/simd.h"
#include "mapping/labels/frame_segment_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace felt::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::RebindToSigned<FloatTag>;
using ByteTag = hn::Rebind<uint8_t, FloatTag>;
using FloatVec = hn::Vec<FloatTag>;
using FloatMask = hn::Mask<FloatTag>;
constexpr FloatTag kF;
constexpr IntTag kI;
constexpr ByteTag kB;

/// Calls `work` with the first pixel of each vector of a run. The last overlaps the one before it, so what is done must
/// not change when it is done twice. False, and nothing done, where the run is shorter than a vector.
template <typename Work>
HWY_INLINE bool for_vectors(int first, int end, const Work& work) {
  const int lanes = int(hn::Lanes(kF));
  if (end - first < lanes) return false;
  int u = first;
  for (; u + lanes <= end; u += lanes) work(u);
  if (u < end) work(end - lanes);
  return true;
}

HWY_INLINE FloatMask within(FloatVec a, FloatVec b, FloatVec limit) { return hn::Lt(hn::Abs(hn::Sub(a, b)), limit); }

HWY_INLINE hn::Vec<ByteTag> bytes_of(FloatMask mask) {
  return hn::DemoteTo(kB, hn::IfThenElseZero(hn::RebindMask(kI, mask), hn::Set(kI, 1)));
}

HWY_INLINE void clear_unless(FloatMask mask, uint8_t* joined) {
  hn::StoreU(hn::And(hn::LoadU(kB, joined), bytes_of(mask)), kB, joined);
}

HWY_INLINE void normalise(FloatVec& x, FloatVec& y, FloatVec& z) {
  const FloatVec square = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
  const FloatVec scale = hn::Div(hn::Set(kF, 1.0f), hn::Sqrt(hn::Add(square, hn::Set(kF, 1e-20f))));
  x = hn::Mul(x, scale), y = hn::Mul(y, scale), z = hn::Mul(z, scale);
}

void smooth_row(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end, const float* value,
                float* mean) {
  const FloatVec one = hn::Set(kF, 1.0f);
  const bool done = for_vectors(first, end, [&](int u) {
    const FloatVec d = hn::LoadU(kF, row.depth + u), limit = hn::LoadU(kF, row.step + u);
    FloatVec sum = hn::LoadU(kF, value + u), count = one;
    for (int k = 1; k <= reach; ++k) {
      const std::ptrdiff_t a = u - k * stride, b = u + k * stride;
      const FloatMask before = within(hn::LoadU(kF, row.depth + a), d, limit),
                      after = within(hn::LoadU(kF, row.depth + b), d, limit);
      sum = hn::Add(sum, hn::Add(hn::IfThenElseZero(before, hn::LoadU(kF, value + a)),
                                 hn::IfThenElseZero(after, hn::LoadU(kF, value + b))));
      count = hn::Add(count, hn::Add(hn::IfThenElseZero(before, one), hn::IfThenElseZero(after, one)));
    }
    hn::StoreU(hn::Div(sum, count), kF, mean + u);
  });
  if (!done) smooth_row_scalar(row, stride, reach, first, end, value, mean);
}

void smooth_normal_row(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end,
                       const float* const value[3], float* const mean[3], bool unit) {
  const FloatVec one = hn::Set(kF, 1.0f);
  const bool done = for_vectors(first, end, [&](int u) {
    const FloatVec d = hn::LoadU(kF, row.depth + u), limit = hn::LoadU(kF, row.step + u);
    FloatVec x = hn::LoadU(kF, value[0] + u), y = hn::LoadU(kF, value[1] + u), z = hn::LoadU(kF, value[2] + u);
    FloatVec count = one;
    for (int k = 1; k <= reach; ++k) {
      const std::ptrdiff_t a = u - k * stride, b = u + k * stride;
      const FloatMask before = within(hn::LoadU(kF, row.depth + a), d, limit),
                      after = within(hn::LoadU(kF, row.depth + b), d, limit);
      const auto add = [&](const float* from, FloatVec& sum) {
        sum = hn::Add(sum, hn::Add(hn::IfThenElseZero(before, hn::LoadU(kF, from + a)),
                                   hn::IfThenElseZero(after, hn::LoadU(kF, from + b))));
      };
      add(value[0], x), add(value[1], y), add(value[2], z);
      count = hn::Add(count, hn::Add(hn::IfThenElseZero(before, one), hn::IfThenElseZero(after, one)));
    }
    x = hn::Div(x, count), y = hn::Div(y, count), z = hn::Div(z, count);
    if (unit) normalise(x, y, z);
    hn::StoreU(x, kF, mean[0] + u);
    hn::StoreU(y, kF, mean[1] + u);
    hn::StoreU(z, kF, mean[2] + u);
  });
  if (!done) smooth_normal_row_scalar(row, stride, reach, first, end, value, mean, unit);
}

void normal_row(const NormalView& view, const DepthRow& row, int v, int first, int end, float* const normal[3]) {
  const FloatVec pixels = hn::Set(kF, float(view.reach)), twice_pixels = hn::Set(kF, 2 * float(view.reach));
  const FloatVec fx = hn::Set(kF, -view.fx), fy = hn::Set(kF, -view.fy), cx = hn::Set(kF, view.cx),
                 y_of_row = hn::Set(kF, float(v) - view.cy), none = hn::Set(kF, -1.0f);
  const bool done = for_vectors(first, end, [&](int u) {
    const float* const at = row.depth + u;
    const FloatVec d = hn::LoadU(kF, at), step = hn::LoadU(kF, row.step + u), limit = hn::Add(step, step);
    const auto slope = [&](std::ptrdiff_t far, bool has_back, bool has_ahead) {
      // No difference is below -1: a side that the image has not is never used.
      const FloatVec back = hn::Sub(d, hn::LoadU(kF, has_back ? at - far : at)),
                     ahead = hn::Sub(hn::LoadU(kF, has_ahead ? at + far : at), d);
      const FloatMask use_back = hn::Lt(hn::Abs(back), has_back ? limit : none),
                      use_ahead = hn::Lt(hn::Abs(ahead), has_ahead ? limit : none);
      const FloatVec sum = hn::Add(hn::IfThenElseZero(use_back, back), hn::IfThenElseZero(use_ahead, ahead));
      return hn::Div(sum, hn::IfThenElse(hn::And(use_back, use_ahead), twice_pixels, pixels));
    };
    const FloatVec su = slope(view.reach, view.left, view.right);
    const FloatVec sv = slope(std::ptrdiff_t(view.reach) * view.width, view.up, view.down);
    const FloatVec x_of_column = hn::Sub(hn::ConvertTo(kF, hn::Iota(kI, u)), cx);
    FloatVec x = hn::Mul(fx, su), y = hn::Mul(fy, sv);
    FloatVec z = hn::Add(hn::Add(d, hn::Mul(x_of_column, su)), hn::Mul(y_of_row, sv));
    normalise(x, y, z);
    hn::StoreU(x, kF, normal[0] + u);
    hn::StoreU(y, kF, normal[1] + u);
    hn::StoreU(z, kF, normal[2] + u);
  });
  if (!done) normal_row_scalar(view, row, v, first, end, normal);
}

HWY_INLINE FloatVec dot(const FloatVec (&n)[3], FloatVec x, FloatVec y, FloatVec z) {
  return hn::Add(hn::Add(hn::Mul(n[0], x), hn::Mul(n[1], y)), hn::Mul(n[2], z));
}

void join_row(const SurfaceRow& s, int v, std::ptrdiff_t next, int first, int end, uint8_t* joined) {
  const bool along_row = next == 1;
  const float row_y0 = (float(v) - s.cy) * s.per_fy;
  const FloatVec y0 = hn::Set(kF, row_y0), y1 = hn::Set(kF, along_row ? row_y0 : row_y0 + s.per_fy);
  const FloatVec per_fx = hn::Set(kF, s.per_fx), cx = hn::Set(kF, s.cx), share = hn::Set(kF, s.plane_of_step);
  const bool done = for_vectors(first, end, [&](int u) {
    const std::ptrdiff_t o = u + next;
    const FloatVec d = hn::LoadU(kF, s.row.depth + u), other = hn::LoadU(kF, s.row.depth + o);
    const FloatVec limit = hn::LoadU(kF, s.row.step + u), tolerance = hn::Mul(share, limit);
    const FloatVec x0 = hn::Mul(hn::Sub(hn::ConvertTo(kF, hn::Iota(kI, u)), cx), per_fx);
    const FloatVec x1 = along_row ? hn::Add(x0, per_fx) : x0;
    const FloatVec px = hn::Sub(hn::Mul(other, x1), hn::Mul(d, x0)), py = hn::Sub(hn::Mul(other, y1), hn::Mul(d, y0)),
                   pz = hn::Sub(other, d);
    const auto off = [&](std::ptrdiff_t at) {
      const FloatVec n[3] = {hn::LoadU(kF, s.normal[0] + at), hn::LoadU(kF, s.normal[1] + at),
                             hn::LoadU(kF, s.normal[2] + at)};
      return hn::Abs(dot(n, px, py, pz));
    };
    const FloatMask near = hn::Lt(hn::Abs(pz), limit),
                    flat = hn::And(hn::Lt(off(u), tolerance), hn::Lt(off(o), tolerance)),
                    measured = hn::Gt(hn::LoadU(kF, s.row.step + o), hn::Zero(kF));
    hn::StoreU(bytes_of(hn::And(hn::And(near, flat), measured)), kB, joined + u);
  });
  if (!done) join_row_scalar(s, v, next, first, end, joined);
}

void part_row_by_normals(const SurfaceRow& s, std::ptrdiff_t next, int reach, int first, int end, uint8_t* joined) {
  const std::ptrdiff_t far = reach * next;
  const FloatVec least_cos = hn::Set(kF, s.least_cos);
  const bool done = for_vectors(first, end, [&](int u) {
    const std::ptrdiff_t o = u + next;
    const FloatVec d = hn::LoadU(kF, s.row.depth + u), step = hn::LoadU(kF, s.row.step + u),
                   limit = hn::Add(step, step);
    const FloatMask before = within(hn::LoadU(kF, s.row.depth + u - far), d, limit),
                    beyond = within(hn::LoadU(kF, s.row.depth + o + far), d, limit);
    FloatVec a[3], b[3];
    for (int c = 0; c < 3; ++c) {
      const float* const n = s.normal[c];
      a[c] = hn::IfThenElse(before, hn::LoadU(kF, n + u - far), hn::LoadU(kF, n + u));
      b[c] = hn::IfThenElse(beyond, hn::LoadU(kF, n + o + far), hn::LoadU(kF, n + o));
    }
    clear_unless(hn::Gt(dot(a, b[0], b[1], b[2]), least_cos), joined + u);
  });
  if (!done) part_row_by_normals_scalar(s, next, reach, first, end, joined);
}

void part_row_by_color(const Rgba8* row, std::ptrdiff_t next, int limit, int first, int end, uint8_t* joined) {
  const auto low = hn::Set(kI, 0xff), red_and_blue = hn::Set(kI, 0xff00ff), half = hn::Set(kI, 0xffff);
  const auto most = hn::Set(kI, limit);
  const bool done = for_vectors(first, end, [&](int u) {
    // Red and blue are summed side by side: three bytes fit 16 bits.
    const auto sums = [&](std::ptrdiff_t at, std::ptrdiff_t along, auto& rb, auto& g) {
      rb = g = hn::Zero(kI);
      for (int k = 0; k < 3; ++k) {
        const auto c = hn::LoadU(kI, reinterpret_cast<const int32_t*>(row + at + k * along));
        rb = hn::Add(rb, hn::And(c, red_and_blue));
        g = hn::Add(g, hn::And(hn::ShiftRight<8>(c), low));
      }
    };
    hn::Vec<IntTag> rb_before, g_before, rb_after, g_after;
    sums(u, -next, rb_before, g_before);
    sums(u + next, next, rb_after, g_after);
    const auto r = hn::Sub(hn::And(rb_after, half), hn::And(rb_before, half));
    const auto b = hn::Sub(hn::ShiftRight<16>(rb_after), hn::ShiftRight<16>(rb_before));
    const auto g = hn::Sub(g_after, g_before);
    const auto square = hn::Add(hn::Add(hn::Mul(r, r), hn::Mul(g, g)), hn::Mul(b, b));
    clear_unless(hn::RebindMask(kF, hn::Not(hn::Gt(square, most))), joined + u);
  });
  if (!done) part_row_by_color_scalar(row, next, limit, first, end, joined);
}

}  // namespace felt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {

static_assert(sizeof(Rgba8) == 4, "colours are read as integers with red in the lowest byte");

HWY_EXPORT(smooth_row);
HWY_EXPORT(smooth_normal_row);
HWY_EXPORT(normal_row);
HWY_EXPORT(join_row);
HWY_EXPORT(part_row_by_normals);
HWY_EXPORT(part_row_by_color);

void smooth_row(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end, const float* value,
                float* mean) noexcept {
  if (simd_scalar_forced()) return smooth_row_scalar(row, stride, reach, first, end, value, mean);
  HWY_DYNAMIC_DISPATCH(smooth_row)(row, stride, reach, first, end, value, mean);
}

void smooth_normal_row(const DepthRow& row, std::ptrdiff_t stride, int reach, int first, int end,
                       const float* const value[3], float* const mean[3], bool unit) noexcept {
  if (simd_scalar_forced()) return smooth_normal_row_scalar(row, stride, reach, first, end, value, mean, unit);
  HWY_DYNAMIC_DISPATCH(smooth_normal_row)(row, stride, reach, first, end, value, mean, unit);
}

void normal_row(const NormalView& view, const DepthRow& row, int v, int first, int end,
                float* const normal[3]) noexcept {
  if (simd_scalar_forced()) return normal_row_scalar(view, row, v, first, end, normal);
  HWY_DYNAMIC_DISPATCH(normal_row)(view, row, v, first, end, normal);
}

void join_row(const SurfaceRow& surface, int v, std::ptrdiff_t next, int first, int end, uint8_t* joined) noexcept {
  if (simd_scalar_forced()) return join_row_scalar(surface, v, next, first, end, joined);
  HWY_DYNAMIC_DISPATCH(join_row)(surface, v, next, first, end, joined);
}

void part_row_by_normals(const SurfaceRow& surface, std::ptrdiff_t next, int reach, int first, int end,
                         uint8_t* joined) noexcept {
  if (simd_scalar_forced()) return part_row_by_normals_scalar(surface, next, reach, first, end, joined);
  HWY_DYNAMIC_DISPATCH(part_row_by_normals)(surface, next, reach, first, end, joined);
}

void part_row_by_color(const Rgba8* row, std::ptrdiff_t next, int limit, int first, int end, uint8_t* joined) noexcept {
  if (simd_scalar_forced()) return part_row_by_color_scalar(row, next, limit, first, end, joined);
  HWY_DYNAMIC_DISPATCH(part_row_by_color)(row, next, limit, first, end, joined);
}

}  // namespace felt
#endif
