#pragma once

#include <span>

namespace felt {

// A Dirichlet over k classes is the span of its concentrations a_i > 0; a class probability w ~ Dir(a) has mean a_i/A,
// A = sum a. All functions need k >= 1 and positive finite concentrations.

/// A = sum a_i.
double total_concentration(std::span<const double> a);

/// Concentrations of the Dirichlet nearest (in KL(mixture || Dirichlet)) to sum_j r_j Dir(a + e_j): solves
/// digamma(out_i) - digamma(sum out) = E[ln w_i] by Newton (Hessian: diagonal plus rank one), in differences to `a` so
/// that large concentrations do not cancel. `r` sums to 1. k = 1: a + 1. All spans of one length; `out` may alias `a`.
void project_dirichlet_kl(std::span<const double> a, std::span<const double> r, std::span<double> out);

/// The same with the moment set {w, w^2} of each component, as published: each a^_i from its own beta marginal, so that
/// they share no normaliser (a loose match, always positive). `not_r[i]` = 1 - r[i]. k = 1: a + 1.
void project_dirichlet_published(std::span<const double> a, std::span<const double> r, std::span<const double> not_r,
                                 std::span<double> out);

}  // namespace felt
