// Pairs of Highway vectors of f32 as one value. The special functions are long chains of dependent operations; two
// independent chains side by side keep the arithmetic units busy where one would wait for its own results. Included
// once per SIMD target. Names and arguments are Highway's.
#if defined(FELT_INFERENCE_BATCH_VECTOR_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_VECTOR_INL_H_
#undef FELT_INFERENCE_BATCH_VECTOR_INL_H_
#else
#define FELT_INFERENCE_BATCH_VECTOR_INL_H_
#endif

#include <hwy/highway.h>

#include <cstddef>

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {
namespace pair {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::ScalableTag<float>;
struct V {
  hn::Vec<Tag> lo, hi;
};
struct M {
  hn::Mask<Tag> lo, hi;
};

HWY_INLINE size_t lanes() { return 2 * hn::Lanes(Tag()); }

HWY_INLINE V Set(float x) { return {hn::Set(Tag(), x), hn::Set(Tag(), x)}; }
HWY_INLINE V Zero() { return {hn::Zero(Tag()), hn::Zero(Tag())}; }
HWY_INLINE V LoadU(const float* p) { return {hn::LoadU(Tag(), p), hn::LoadU(Tag(), p + hn::Lanes(Tag()))}; }
HWY_INLINE void StoreU(V x, float* p) {
  hn::StoreU(x.lo, Tag(), p);
  hn::StoreU(x.hi, Tag(), p + hn::Lanes(Tag()));
}
HWY_INLINE void BlendedStore(V x, M where, float* p) {
  hn::BlendedStore(x.lo, where.lo, Tag(), p);
  hn::BlendedStore(x.hi, where.hi, Tag(), p + hn::Lanes(Tag()));
}

HWY_INLINE V Neg(V a) { return {hn::Neg(a.lo), hn::Neg(a.hi)}; }
HWY_INLINE V Abs(V a) { return {hn::Abs(a.lo), hn::Abs(a.hi)}; }
HWY_INLINE V Sqrt(V a) { return {hn::Sqrt(a.lo), hn::Sqrt(a.hi)}; }
HWY_INLINE V Round(V a) { return {hn::Round(a.lo), hn::Round(a.hi)}; }
HWY_INLINE V Add(V a, V b) { return {hn::Add(a.lo, b.lo), hn::Add(a.hi, b.hi)}; }
HWY_INLINE V Sub(V a, V b) { return {hn::Sub(a.lo, b.lo), hn::Sub(a.hi, b.hi)}; }
HWY_INLINE V Mul(V a, V b) { return {hn::Mul(a.lo, b.lo), hn::Mul(a.hi, b.hi)}; }
HWY_INLINE V Div(V a, V b) { return {hn::Div(a.lo, b.lo), hn::Div(a.hi, b.hi)}; }
HWY_INLINE V Min(V a, V b) { return {hn::Min(a.lo, b.lo), hn::Min(a.hi, b.hi)}; }
HWY_INLINE V Max(V a, V b) { return {hn::Max(a.lo, b.lo), hn::Max(a.hi, b.hi)}; }
HWY_INLINE V MulAdd(V a, V b, V c) { return {hn::MulAdd(a.lo, b.lo, c.lo), hn::MulAdd(a.hi, b.hi, c.hi)}; }
HWY_INLINE V MulSub(V a, V b, V c) { return {hn::MulSub(a.lo, b.lo, c.lo), hn::MulSub(a.hi, b.hi, c.hi)}; }
HWY_INLINE V NegMulAdd(V a, V b, V c) { return {hn::NegMulAdd(a.lo, b.lo, c.lo), hn::NegMulAdd(a.hi, b.hi, c.hi)}; }

HWY_INLINE M Eq(V a, V b) { return {hn::Eq(a.lo, b.lo), hn::Eq(a.hi, b.hi)}; }
HWY_INLINE M Lt(V a, V b) { return {hn::Lt(a.lo, b.lo), hn::Lt(a.hi, b.hi)}; }
HWY_INLINE M Le(V a, V b) { return {hn::Le(a.lo, b.lo), hn::Le(a.hi, b.hi)}; }
HWY_INLINE M Gt(V a, V b) { return {hn::Gt(a.lo, b.lo), hn::Gt(a.hi, b.hi)}; }
HWY_INLINE M Ge(V a, V b) { return {hn::Ge(a.lo, b.lo), hn::Ge(a.hi, b.hi)}; }
HWY_INLINE M And(M a, M b) { return {hn::And(a.lo, b.lo), hn::And(a.hi, b.hi)}; }
HWY_INLINE M Or(M a, M b) { return {hn::Or(a.lo, b.lo), hn::Or(a.hi, b.hi)}; }
HWY_INLINE M AndNot(M a, M b) { return {hn::AndNot(a.lo, b.lo), hn::AndNot(a.hi, b.hi)}; }
HWY_INLINE bool AllFalse(M a) { return hn::AllFalse(Tag(), hn::Or(a.lo, a.hi)); }
HWY_INLINE bool AllTrue(M a) { return hn::AllTrue(Tag(), hn::And(a.lo, a.hi)); }
HWY_INLINE V IfThenElse(M m, V a, V b) { return {hn::IfThenElse(m.lo, a.lo, b.lo), hn::IfThenElse(m.hi, a.hi, b.hi)}; }
HWY_INLINE V IfThenElseZero(M m, V a) { return {hn::IfThenElseZero(m.lo, a.lo), hn::IfThenElseZero(m.hi, a.hi)}; }
HWY_INLINE V IfThenZeroElse(M m, V a) { return {hn::IfThenZeroElse(m.lo, a.lo), hn::IfThenZeroElse(m.hi, a.hi)}; }

using IntTag = hn::RebindToSigned<Tag>;

/// u = 2^exponent mantissa with mantissa in [sqrt(1/2), sqrt(2)), u normal and positive.
struct Binary {
  V exponent, mantissa;
};
HWY_INLINE Binary SplitBinary(V u) {
  constexpr IntTag i;
  const auto split = [&](hn::Vec<Tag> x, hn::Vec<Tag>& exponent, hn::Vec<Tag>& mantissa) HWY_ATTR {
    const auto bits = hn::BitCast(i, x);
    const auto e = hn::ShiftRight<23>(hn::Sub(bits, hn::Set(i, 0x3F3504F3)));  // bits of sqrt(1/2)
    exponent = hn::ConvertTo(Tag(), e);
    mantissa = hn::BitCast(Tag(), hn::Sub(bits, hn::ShiftLeft<23>(e)));
  };
  Binary b;
  split(u.lo, b.exponent.lo, b.mantissa.lo);
  split(u.hi, b.exponent.hi, b.mantissa.hi);
  return b;
}

/// 2^n for whole n from -126 to 127.
HWY_INLINE V PowerOfTwo(V n) {
  constexpr IntTag i;
  const auto power = [&](hn::Vec<Tag> x) HWY_ATTR {
    return hn::BitCast(Tag(), hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(i, x), hn::Set(i, 127))));
  };
  return {power(n.lo), power(n.hi)};
}

}  // namespace pair
}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
