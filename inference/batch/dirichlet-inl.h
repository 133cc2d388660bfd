// Dirichlet projection of sum_j r_j Dir(a + e_j) on Highway vectors: one vector holds one class of as many voxels as it
// has lanes. Included once per SIMD target. inference/dirichlet.h is the specification, docs/batch_kernels.md explains
// the start and the step.
#if defined(FELT_INFERENCE_BATCH_DIRICHLET_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef FELT_INFERENCE_BATCH_DIRICHLET_INL_H_
#undef FELT_INFERENCE_BATCH_DIRICHLET_INL_H_
#else
#define FELT_INFERENCE_BATCH_DIRICHLET_INL_H_
#endif

#include <hwy/highway.h>

#include "inference/batch/limits.h"
#include "inference/batch/math-inl.h"
#include "inference/batch/row-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

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
  Row share_term, residual, slope;

  HWY_INLINE V x(size_t c) const { return pair::Max(pair::Add(a.load(c), step.load(c)), constant(kLeastCount)); }
};

/// Starting values in two passes. Alone, class i would move to a_i + u_i with digamma(a_i + u_i) - digamma(a_i) =
/// r_i/a_i, near enough u = r a/(a + (1-r) c), c from 1 (small a) to 1/2. All then give way together, each by
/// 1/trigamma(x_i), x^2/(x + c) near enough, so that they sum to the total that belongs to them. In the whole range of
/// ordinary voxels the result is within 1.1 % of the solution.
class DirichletStart {
public:
  HWY_INLINE DirichletStart() : missing_(pair::Zero()), sum_excess_(pair::Zero()) {}

  /// First pass: leaves u in rows.step and x/(x + c) in rows.slope.
  HWY_INLINE void add(const DirichletRows& rows, size_t c, V a, V r, V not_r) {
    const V aq = pair::Add(a, constant(kSmallA)), half_a = pair::MulAdd(a, constant(0.5f), constant(kSmallA));
    const V a_aq = pair::Mul(a, aq), give = pair::Mul(not_r, half_a);
    const V r_over = pair::Div(r, pair::Add(a_aq, give));
    const V u = pair::Mul(r_over, a_aq);
    missing_ = pair::MulAdd(r_over, give, missing_);
    const V x = pair::Add(a, u);
    const Excess e = excess(x);
    sum_excess_ = pair::Add(sum_excess_, e.excess);
    rows.step.store(u, c);
    rows.slope.store(e.share, c);
  }

  /// Between the passes. `total`: sum of a.
  HWY_INLINE void balance(V total) {
    const V s = pair::Add(total, constant(1.0f));
    const V stiffness = pair::Max(pair::Sub(sum_excess_, excess(s).excess), pair::Zero());
    give_way_ = pair::Div(missing_, pair::Add(pair::Add(missing_, stiffness), constant(1e-30f)));
  }

  /// Second pass: leaves the step in rows.step and returns it.
  HWY_INLINE V finish(const DirichletRows& rows, size_t c) const {
    const V u = rows.step.load(c), x = pair::Add(rows.a.load(c), u);
    const V z = pair::Mul(give_way_, rows.slope.load(c));
    const V step = pair::Sub(u, pair::Mul(x, pair::Div(z, pair::Add(constant(1.0f), z))));
    rows.step.store(step, c);
    return step;
  }

private:
  static constexpr float kSmallA = 0.3f, kSmallX = 0.2f;

  struct Excess {
    V share;   ///< 1/(x trigamma(x)), nearly
    V excess;  ///< x (1 - share)
  };
  static HWY_INLINE Excess excess(V x) {
    const V xp = pair::Add(x, constant(kSmallX)), half_x = pair::MulAdd(x, constant(0.5f), constant(kSmallX));
    const V x_xp = pair::Mul(x, xp);
    const V inverse = pair::Div(constant(1.0f), pair::Add(x_xp, half_x));
    return {pair::Mul(x_xp, inverse), pair::Mul(pair::Mul(x, half_x), inverse)};
  }

  V missing_;     ///< sum of r - u, without cancellation
  V sum_excess_;  ///< sum of x - 1/trigamma(x)
  V give_way_;    ///< common fall of the digammas
};

constexpr int kMostNewtonSteps = 40;

/// A step of this relative size leaves at most 1.3e-5 (a >= 1; docs/batch_kernels.md).
constexpr float kLastStep = 0.012f;

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
      const DigammaEnd x_end = digamma_end(x), a_end = digamma_end(rows.a.load(c));
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
    // Far from the solution the second order may not outvote the first; near it, it is small itself.
    const V limit = pair::MulAdd(half, pair::Abs(common), constant(1e-3f));
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
    // A voxel that is done stays as it is, whatever its neighbours need.
    live = pair::And(live, pair::Gt(largest, constant(kLastStep)));
    if (pair::AllFalse(live)) break;
  }
}

/// Second pass of the start, then the solution: writes rows.step and uses the rows below it.
HWY_INLINE void project_dirichlet(const DirichletRows& rows, DirichletStart& start, size_t k, V total, M live) {
  start.balance(total);
  V sum_x = pair::Zero(), largest_x = sum_x, its_a = sum_x, its_step = sum_x;
  for (size_t c = 0; c < k; ++c) {
    const V a = rows.a.load(c), step = start.finish(rows, c), x = pair::Add(a, step);
    const M larger = pair::Gt(x, largest_x);
    its_step = pair::IfThenElse(larger, step, its_step);
    its_a = pair::IfThenElse(larger, a, its_a);
    largest_x = pair::Max(largest_x, x);
    sum_x = pair::Add(sum_x, x);
  }
  const M dominant = pair::Lt(pair::Mul(pair::Sub(sum_x, largest_x), its_a),
                              pair::Mul(pair::Mul(constant(2.0f), largest_x), pair::Abs(its_step)));
  if (pair::AllFalse(pair::And(dominant, live))) return iterate_dirichlet<false>(rows, k, total, live, dominant);

  // E[ln w_i] + digamma(A + 1 - 1) - digamma(a_i) - 1/A, with r/a - 1/A over one denominator.
  SumOfOthers sum_a;
  for (size_t c = 0; c < k; ++c) sum_a.add(rows.a.load(c));
  const DigammaEnd total_end = digamma_end(total);
  for (size_t c = 0; c < k; ++c) {
    const V a = rows.a.load(c), others = sum_a.others(a);
    const DigammaEnd a_end = digamma_end(a);
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
