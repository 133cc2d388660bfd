#!/usr/bin/env python3
"""Coefficients of the polynomials in inference/batch/math-inl.h: weighted minimax fits (Remez exchange) at 40 digits.

    fit_batch_math.py            # prints each polynomial, lowest power first, with its weighted error

Needs only python3-mpmath. What the kernels do with them in f32 is bounded by tests/unit/inference/batch_functions_test.cpp.
"""
from mpmath import cos, digamma, exp, log, log1p, loggamma, lu_solve, matrix, mp, mpf, nstr, pi, polyval, psi, sqrt

mp.dps = 40
SMALL = mpf("1e-6")  # fits are taken from here instead of 0, where the formulas are 0/0


def minimax(f, weight, terms, lo, hi, points=400, rounds=12):
    """Polynomial with `terms` coefficients that minimises max |weight (p - f)| on [lo, hi], and that maximum."""
    grid = [(lo + hi) / 2 + (hi - lo) / 2 * cos(pi * (2 * i + 1) / (2 * points)) for i in range(points)][::-1]
    values, weights = [f(x) for x in grid], [weight(x) for x in grid]
    at = [int((points - 1) * (1 - cos(pi * i / terms)) / 2) for i in range(terms + 1)]
    for _ in range(rounds):
        A, b = matrix(terms + 1, terms + 1), matrix(terms + 1, 1)
        for row, i in enumerate(at):
            for j in range(terms):
                A[row, j] = grid[i] ** j
            A[row, terms] = (-1) ** row / weights[i]
            b[row] = values[i]
        solved = lu_solve(A, b)
        c = [solved[j] for j in range(terms)]
        error = [(polyval(c[::-1], x) - v) * w for x, v, w in zip(grid, values, weights)]
        extrema, start = [], 0
        for i in range(1, points + 1):
            if i == points or (error[i] > 0) != (error[start] > 0):
                extrema.append(max(range(start, i), key=lambda q: abs(error[q])))
                start = i
        while len(extrema) > terms + 1:
            extrema.pop(0 if abs(error[extrema[0]]) < abs(error[extrema[-1]]) else -1)
        if len(extrema) < terms + 1:
            break
        at = extrema
    return c, max(abs(x) for x in error)


def log1p_tail(f):
    """(log1p(f) - f) / f^2."""
    return -mpf(1) / 2 + f / 3 if abs(f) < mpf("1e-12") else (log1p(f) - f) / f**2


def shifted_d_tail(s):
    """P with D(1/t) = t/2 + t^2/12 - t^4 P(t^2), D(x) = ln x - digamma(x)."""
    t = sqrt(max(s, SMALL))
    return (t / 2 + t * t / 12 - (log(1 / t) - digamma(1 / t))) / t**4


def trigamma_excess(t):
    """c(a) = a^2 trigamma(a) - a with a = 1/t - 1."""
    a = 1 / max(t, SMALL) - 1
    return 1 - a + a * a * psi(1, a + 1)


def half_step_excess(t):
    """w(b) = (Gamma(b + 1) / Gamma(b + 1/2))^2 - b with b = 1/t - 1."""
    b = 1 / max(t, SMALL) - 1
    return exp(2 * (loggamma(b + 1) - loggamma(b + mpf(1) / 2))) - b


def stirling_tail(s):
    """P with lgamma(x) = (x - 1/2) ln x - x + ln(2 pi)/2 + t/12 - t^3 P(t^2), t = 1/x."""
    t = sqrt(max(s, SMALL))
    x = 1 / t
    return (t / 12 - (loggamma(x) - (x - mpf(1) / 2) * log(x) + x - log(2 * pi) / 2)) / t**3


def shape_of(t):
    """b with t = 1/(b + 1/2)."""
    return 1 / max(t, SMALL) - mpf(1) / 2


def d(x):
    return log(x) - digamma(x)


def shape_d(t):
    """b D(b)."""
    return shape_of(t) * d(shape_of(t))


def digamma_half_step(t):
    """P with digamma(b + 1/2) - digamma(b) = 1/(2b) + (t/b) P."""
    b = shape_of(t)
    return (digamma(b + mpf(1) / 2) - digamma(b) - 1 / (2 * b)) * b / max(t, SMALL)


def inverse_d(s):
    """s b with D(b) = s."""
    s = max(s, SMALL)
    b = (3 - s + sqrt((s - 3) ** 2 + 24 * s)) / (12 * s)
    for _ in range(60):
        b -= (d(b) - s) / (1 / b - psi(1, b))
    return s * b


def weight_d(s):
    s = max(s, SMALL)
    return s**2 / (log(1 / sqrt(s)) - digamma(1 / sqrt(s)))


FITS = [
    ("log1p_tail", log1p_tail, lambda f: 1 / abs(log1p_tail(f)), 10, sqrt(mpf(1) / 2) - 1, sqrt(mpf(2)) - 1),
    ("shifted_d_tail", shifted_d_tail, weight_d, 5, mpf(0), mpf(1)),
    ("trigamma_excess", trigamma_excess, lambda t: 1 / trigamma_excess(t), 8, mpf(0), mpf(1)),
    ("half_step_excess", half_step_excess, lambda t: 1 / (1 / max(t, SMALL) - 1 + half_step_excess(t)), 5, mpf(0), mpf(1)),
    ("shape_d", shape_d, lambda t: 1 / shape_d(t), 7, mpf(0), mpf(2) / 3),
    ("digamma_half_step", digamma_half_step, lambda t: max(t, SMALL) / shape_d(t), 5, mpf(0), mpf(2) / 3),
    ("inverse_d", inverse_d, lambda s: 1 / inverse_d(s), 7, mpf(0), -digamma(mpf(1))),
    ("stirling_tail", stirling_tail, lambda s: max(s, SMALL) ** mpf("1.5"), 4, mpf(0), mpf(1)),
]

if __name__ == "__main__":
    for name, f, weight, terms, lo, hi in FITS:
        c, error = minimax(f, weight, terms, lo, hi)
        print(f"{name}: error {nstr(error, 3)}\n    {{{', '.join(nstr(x, 10) + 'f' for x in c)}}}")
