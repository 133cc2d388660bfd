// Scratch of the batch kernels. Included once per SIMD target.
#if defined(FELT_INFERENCE_BATCH_ROW_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_ROW_INL_H_
#undef FELT_INFERENCE_BATCH_ROW_INL_H_
#else
#define FELT_INFERENCE_BATCH_ROW_INL_H_
#endif

#include <hwy/highway.h>

#include "inference/batch/math-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

/// One vector a class, `lanes` apart.
class Row {
public:
  Row(float* at, size_t lanes) : at_(at), lanes_(lanes) {}
  HWY_INLINE V load(size_t c) const { return pair::LoadU(at_ + c * lanes_); }
  HWY_INLINE void store(V x, size_t c) const { pair::StoreU(x, at_ + c * lanes_); }

private:
  float* at_;
  size_t lanes_;
};

/// Weights of classes relative to the largest, which is exactly 1. What the others weigh together is summed apart, so
/// that 1 - r of the largest keeps its digits where r is within rounding of 1.
class Weights {
public:
  HWY_INLINE Weights() : others_(pair::Zero()), largest_(pair::Zero()) {}

  HWY_INLINE void add(V w) {
    const M ties = pair::Eq(w, constant(1.0f));
    largest_ = pair::Add(largest_, pair::IfThenElseZero(ties, constant(1.0f)));
    others_ = pair::Add(others_, pair::IfThenZeroElse(ties, w));
  }
  HWY_INLINE void close() {
    others_ = pair::Add(others_, pair::Sub(largest_, constant(1.0f)));
    total_ = pair::Add(constant(1.0f), others_);
    inv_total_ = pair::Div(constant(1.0f), total_);
  }

  // After close():
  HWY_INLINE V total() const { return total_; }
  HWY_INLINE V share(V w) const { return pair::Mul(w, inv_total_); }
  /// 1 - share(w)
  HWY_INLINE V not_share(V w) const {
    const V one = constant(1.0f);
    return pair::IfThenElse(pair::Eq(w, one), pair::Mul(others_, inv_total_), pair::Sub(one, share(w)));
  }

private:
  V others_, largest_, total_, inv_total_;
};

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
