// Dirichlet projection of sum_j r_j Dir(a + e_j) on Highway vectors: one vector holds one class of as many voxels as it
// has lanes. Included once per SIMD target. inference/dirichlet.h is the specification.
#if defined(FELT_INFERENCE_BATCH_DIRICHLET_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_DIRICHLET_INL_H_
#undef FELT_INFERENCE_BATCH_DIRICHLET_INL_H_
#else
#define FELT_INFERENCE_BATCH_DIRICHLET_INL_H_
#endif

#include <hwy/highway.h>

#include "inference/batch_projection-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

/// One vector a class, `kLanes` apart.
class Row {
public:
  Row(float* at, size_t lanes) : at_(at), lanes_(lanes) {}
  HWY_INLINE V load(size_t c) const { return pair::LoadU(at_ + c * lanes_); }
  HWY_INLINE void store(V x, size_t c) const { pair::StoreU(x, at_ + c * lanes_); }

private:
  float* at_;
  size_t lanes_;
};

/// What a difference of digammas needs of one end: 1/x, 1/(1 + x), D(1 + x).
struct DigammaEnd {
  V inv_x, t, shifted;
};

HWY_INLINE DigammaEnd digamma_end(V x) {
  const Reciprocals of = reciprocals(x);
  return {of.of_x, of.of_x_plus_1, shifted_log_minus_digamma(of.of_x_plus_1)};
}

HWY_INLINE DigammaEnd select(M where, const DigammaEnd& yes, const DigammaEnd& no) {
  return {pair::IfThenElse(where, yes.inv_x, no.inv_x), pair::IfThenElse(where, yes.t, no.t),
          pair::IfThenElse(where, yes.shifted, no.shifted)};
}

/// digamma(x + u) - digamma(x), by digamma(x) = ln(1 + x) - 1/x - D(1 + x): no term is larger than 1/x.
HWY_INLINE V digamma_difference(const DigammaEnd& x, V u, const DigammaEnd& end) {
  const V of_log = log1p_of(pair::Mul(u, x.t)).log;
  const V of_inverse = pair::Mul(pair::Mul(u, x.inv_x), end.inv_x);
  return pair::Add(of_log, pair::Add(of_inverse, pair::Sub(x.shifted, end.shifted)));
}

/// Sum of positive numbers, and for each of them the sum of the others without cancellation.
class SumOfOthers {
public:
  HWY_INLINE SumOfOthers() : largest_(pair::Zero()), others_of_largest_(pair::Zero()) {}

  HWY_INLINE void add(V x) {
    others_of_largest_ = pair::Add(others_of_largest_, pair::Min(largest_, x));
    largest_ = pair::Max(largest_, x);
  }
  HWY_INLINE V sum() const { return pair::Add(largest_, others_of_largest_); }
  HWY_INLINE V others(V x) const {
    return pair::IfThenElse(pair::Eq(x, largest_), others_of_largest_, pair::Sub(sum(), x));
  }

private:
  V largest_, others_of_largest_;
};

/// k >= 2 concentrations and responsibilities (r + not_r = 1) as rows, and what the solver writes.
struct DirichletRows {
  Row a, r, not_r;
  Row step;  ///< result: out - a
  Row inv_a, t_a, shifted_a, share_term, residual, slope;

  HWY_INLINE V x(size_t c) const { return pair::Max(pair::Add(a.load(c), step.load(c)), constant(kLeastCount)); }
  HWY_INLINE DigammaEnd end_of_a(size_t c) const { return {inv_a.load(c), t_a.load(c), shifted_a.load(c)}; }
};

constexpr int kMostNewtonSteps = 40;

/// Newton on digamma(out_i) - digamma(sum out) = E[ln w_i] for the lanes `live`. The Hessian's diagonal and its rank
/// one are kept apart: with x^2 trigamma(x) = x + c(x) the inverse of trigamma is x - x c/(x + c), so that the
/// denominator of the rank-one step, 1/trigamma(S) - sum 1/trigamma(x_i), is formed without the two large sums that
/// would cancel. A second-order correction comes from the same function values.
///
/// Residuals are differences to the prior; with kDominant, for the lanes `dominant` where one class holds nearly all,
/// differences to the total instead wherever those are smaller. (A lane's result never depends on the other lanes.)
template <bool kDominant>
HWY_INLINE void iterate_dirichlet(const DirichletRows& rows, size_t k, V total, M live, M dominant) {
  const V one = constant(1.0f), half = constant(0.5f), zero = pair::Zero();
  const DigammaEnd total_end = digamma_end(total);
  for (int iteration = 0; iteration < kMostNewtonSteps; ++iteration) {
    V sum_step = zero;
    SumOfOthers sum_x;
    for (size_t c = 0; c < k; ++c) {
      sum_step = pair::Add(sum_step, rows.step.load(c));
      if (kDominant) sum_x.add(rows.x(c));
    }
    V s = pair::Max(pair::Add(total, sum_step), constant(kLeastCount));
    if (kDominant) s = pair::IfThenElse(dominant, sum_x.sum(), s);
    const DigammaEnd s_end = digamma_end(s);
    const V of_total = pair::Sub(digamma_difference(total_end, sum_step, s_end), total_end.inv_x);
    V sum_g = zero, sum_w = zero;
    for (size_t c = 0; c < k; ++c) {
      const V u = rows.step.load(c), x = rows.x(c);
      const DigammaEnd x_end = digamma_end(x), a_end = rows.end_of_a(c);
      V residual;
      if (kDominant) {
        const V others = sum_x.others(x);
        const M near_total =
            pair::And(dominant, pair::Lt(pair::Mul(others, x_end.inv_x), pair::Mul(pair::Abs(u), a_end.inv_x)));
        const V difference =
            digamma_difference(select(near_total, x_end, a_end), pair::IfThenElse(near_total, others, u),
                               select(near_total, s_end, x_end));
        residual = pair::IfThenElse(near_total, pair::Add(rows.share_term.load(c), difference),
                                    pair::Sub(pair::MulAdd(rows.r.load(c), a_end.inv_x, of_total), difference));
      } else {
        residual = pair::Sub(pair::MulAdd(rows.r.load(c), a_end.inv_x, of_total), digamma_difference(a_end, u, x_end));
      }
      const V excess = trigamma_excess(x_end.t);
      const V slope = pair::Div(x, pair::Add(x, excess));  // 1/(x trigamma(x))
      sum_g = pair::MulAdd(pair::Mul(residual, x), slope, sum_g);
      sum_w = pair::MulAdd(excess, slope, sum_w);
      rows.residual.store(residual, c);
      rows.slope.store(slope, c);
    }
    const V s_excess = trigamma_excess(s_end.t);
    const V s_slope = pair::Div(s, pair::Add(s, s_excess));
    const V inv_rank_one = pair::Div(one, pair::NegMulAdd(s_excess, s_slope, sum_w));
    const V common = pair::Mul(sum_g, inv_rank_one);  // change of digamma(sum out)

    V sum_linear = zero, bend = zero;
    for (size_t c = 0; c < k; ++c) {
      const V slope = rows.slope.load(c);
      const V relative = pair::Mul(pair::Add(rows.residual.load(c), common), slope);
      const V linear = pair::Mul(rows.x(c), relative);
      sum_linear = pair::Add(sum_linear, linear);
      bend = pair::MulAdd(pair::NegMulAdd(half, slope, one), pair::Mul(linear, clamp_to(relative, -0.5f, 0.5f)), bend);
    }
    const V s_relative = clamp_to(pair::Mul(sum_linear, s_end.inv_x), -0.5f, 0.5f);
    bend = pair::NegMulAdd(pair::NegMulAdd(half, s_slope, one), pair::Mul(sum_linear, s_relative), bend);
    const V limit = pair::Mul(half, pair::Abs(common));
    const V second = pair::Max(pair::Neg(limit), pair::Min(limit, pair::Mul(bend, inv_rank_one)));

    V largest = zero;
    for (size_t c = 0; c < k; ++c) {
      const V slope = rows.slope.load(c);
      const V relative = pair::Mul(pair::Add(rows.residual.load(c), common), slope);
      const V curvature = pair::Mul(pair::NegMulAdd(half, slope, one), relative);
      const V bent =
          pair::Div(pair::MulAdd(second, slope, relative), pair::Sub(one, pair::Min(curvature, constant(0.75f))));
      const V moved = pair::IfThenElseZero(live, pair::Max(bent, constant(-0.875f)));  // stays positive
      largest = pair::Max(largest, pair::Abs(moved));
      rows.step.store(pair::MulAdd(rows.x(c), moved, rows.step.load(c)), c);
    }
    // Third order: a step of 5e-3 leaves 1e-5. A voxel that is done stays as it is, whatever its neighbours need.
    live = pair::And(live, pair::Gt(largest, constant(5e-3f)));
    if (pair::AllFalse(live)) break;
  }
}

/// Writes rows.step and uses the rows below it. `overlap` = sum r not_r, `cross` = sum (a + r)(total - a + not_r).
HWY_INLINE void project_dirichlet(const DirichletRows& rows, size_t k, V total, V overlap, V cross, M live) {
  const V one = constant(1.0f);
  // S/(A + 1) - 1 for the S that matches sum E[w_i^2]; start at out_i = (a_i + r_i) S/(A + 1).
  const V scale = pair::Neg(pair::Div(pair::Mul(pair::Add(total, constant(2.0f)), overlap),
                                      pair::MulAdd(pair::Add(total, one), overlap, cross)));
  V sum_x = pair::Zero(), largest_x = sum_x, most_moved = sum_x;
  for (size_t c = 0; c < k; ++c) {
    const V a = rows.a.load(c), r = rows.r.load(c);
    const DigammaEnd end = digamma_end(a);
    const V step = pair::Max(pair::MulAdd(pair::Add(a, r), scale, r), pair::Mul(a, constant(-0.99f)));
    rows.inv_a.store(end.inv_x, c);
    rows.t_a.store(end.t, c);
    rows.shifted_a.store(end.shifted, c);
    rows.step.store(step, c);
    const V x = pair::Add(a, step);
    const M larger = pair::Gt(x, largest_x);
    most_moved = pair::IfThenElse(larger, pair::Mul(pair::Abs(step), end.inv_x), most_moved);
    largest_x = pair::Max(largest_x, x);
    sum_x = pair::Add(sum_x, x);
  }
  const M dominant = pair::Lt(pair::Sub(sum_x, largest_x), pair::Mul(pair::Mul(constant(2.0f), largest_x), most_moved));
  if (pair::AllFalse(pair::And(dominant, live))) return iterate_dirichlet<false>(rows, k, total, live, dominant);

  // E[ln w_i] + digamma(A + 1 - 1) - digamma(a_i) - 1/A, with r/a - 1/A over one denominator.
  SumOfOthers sum_a;
  for (size_t c = 0; c < k; ++c) sum_a.add(rows.a.load(c));
  const DigammaEnd total_end = digamma_end(total);
  for (size_t c = 0; c < k; ++c) {
    const V a = rows.a.load(c), others = sum_a.others(a);
    const DigammaEnd a_end = rows.end_of_a(c);
    const V gain = pair::MulSub(others, rows.r.load(c), pair::Mul(a, rows.not_r.load(c)));
    rows.share_term.store(pair::Sub(pair::Mul(pair::Mul(gain, a_end.inv_x), total_end.inv_x),
                                    digamma_difference(a_end, others, total_end)),
                          c);
  }
  iterate_dirichlet<true>(rows, k, total, live, dominant);
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#endif
