#pragma once

#include <span>

namespace felt {

// A Dirichlet over k classes is the span of its concentrations a_i > 0; a class probability w ~ Dir(a) has mean a_i/A,
// A = sum a. All functions need k >= 1 and positive finite concentrations.

/// Concentrations that project_dirichlet_kl takes.
inline constexpr double kLeastConcentration = 1e-15, kMostConcentration = 1e15;

/// A = sum a_i.
double total_concentration(std::span<const double> a);

/// Concentrations of the Dirichlet nearest (in KL(mixture || Dirichlet)) to sum_j r_j Dir(a + e_j): solves
/// digamma(out_i) - digamma(sum out) = E[ln w_i] by Newton (Hessian: diagonal plus rank one), in differences to `a` so
/// that large concentrations do not cancel, or to E[ln w_i] where one class holds nearly all. `r` sums to 1, `not_r[i]`
/// = 1 - r[i]. k = 1: a + 1. All spans of one length; `out` may alias `a`.
///
/// All NaN where a concentration is outside [1e-15, 1e15], or so far below the largest that doubles do not determine
/// the sum to 1e-6. Relative error below 1e-11 for concentrations from 1e-3 to 1e6, below 1e-7 from 1e-10 to 1e10.
void project_dirichlet_kl(std::span<const double> a, std::span<const double> r, std::span<const double> not_r,
                          std::span<double> out);

/// The same with the moment set {w, w^2} of each component, as published: each a^_i from its own beta marginal, so that
/// they share no normaliser (a loose match, always positive). `not_r[i]` = 1 - r[i]. k = 1: a + 1.
void project_dirichlet_published(std::span<const double> a, std::span<const double> r, std::span<const double> not_r,
                                 std::span<double> out);

}  // namespace felt
