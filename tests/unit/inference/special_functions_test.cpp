#include "inference/special_functions.h"

#include <catch2/catch.hpp>
#include <cmath>

namespace felt {

// Reference values: mpmath at 40 digits.
TEST_CASE("D = ln - digamma and its slope agree with 40-digit values on both sides of the asymptotic series") {
  struct Row {
    double x, d, slope;
  };
  for (const Row& row : {Row{0.001, 993.667816652828143, 0.999001642533195869},
                         {0.1, 8.1211698474170306, 0.914332991507927584},
                         {1.4616321449683622, 0.379553718839518024, 0.605672384855549113},
                         {7.5, 0.0681455362961779685, 0.522144189189588737},
                         {15.99, 0.0315953443423111479, 0.510415050510168627},
                         {16.010000000000002, 0.0315554686583530151, 0.51040206004852502},
                         {10000, 0.0000500008333333325, 0.500016666666633333},
                         {1e9, 5.00000000083333333e-10, 0.500000000166666667}}) {
    INFO("x = " << row.x);
    CHECK(log_minus_digamma(row.x) == Approx(row.d).epsilon(2e-14));
    CHECK(log_minus_digamma_slope(row.x) == Approx(row.slope).epsilon(2e-14));
  }
}

TEST_CASE("differences of ln Gamma agree with 40-digit values where the functions themselves are large") {
  struct Row {
    double x, delta, value;
  };
  for (const Row& row : {Row{0.001, 0.5, -6.33677498788482187},
                         {0.3, 4, 1.08522305154909356},
                         {15.9, 0.5, 1.37529921356875907},
                         {16.1, 0.5, 1.38164690741856971},
                         {1e4, 0.5, 4.60515768598809658},
                         {1e4, 4, 36.8419614179167285},
                         {1e8, 0.5, 9.21034037072618274},
                         {50, 1000, 6107.24771653950848}}) {
    INFO("x = " << row.x << ", delta = " << row.delta);
    CHECK(log_gamma_difference(row.x, row.delta) == Approx(row.value).epsilon(2e-14));
  }
}

TEST_CASE("the inverse of D returns its argument over thirty decades") {
  for (double s = 1e-15; s < 2e15; s *= 1.37) {
    INFO("s = " << s);
    const double x = inverse_log_minus_digamma(s);
    REQUIRE(x > 0);
    CHECK(log_minus_digamma(x) == Approx(s).epsilon(1e-12));
  }
}

TEST_CASE("a difference of digammas keeps its digits where digamma itself has lost them") {
  // digamma(x + n) - digamma(x) = 1/x + ... + 1/(x + n - 1)
  for (double x : {1e-3, 0.7, 12.0, 1e6, 1e12}) {
    CHECK(digamma_difference(x, 1) == Approx(1 / x).epsilon(1e-13));
    CHECK(digamma_difference(x, 3) == Approx(1 / x + 1 / (x + 1) + 1 / (x + 2)).epsilon(1e-13));
    if (x >= 0.7) CHECK(digamma_difference(x + 3, -3) == Approx(-digamma_difference(x, 3)).epsilon(1e-13));
  }
}

}  // namespace felt
