#include "inference/student_t.h"

#include <boost/math/quadrature/sinh_sinh.hpp>
#include <boost/math/quadrature/tanh_sinh.hpp>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

namespace felt {
namespace {

// E[f(psi)] over the real line (or a part of it) by double-exponential quadrature.
template <class F>
double expected(const StudentT& t, F f) {
  const double scale = std::sqrt(t.scale2);
  boost::math::quadrature::sinh_sinh<double> rule(12);
  return rule.integrate([&](double z) {
    const double x = t.location + scale * z;
    return scale * pdf(t, x) * f(x);
  });
}

StudentTMixture two_materials() { return {{0.3, 0.7}, {{0.19, 0.0021, 50}, {0.54, 0.0042, 7}}}; }

template <class F>
double expected(const StudentTMixture& m, F f) {
  double sum = 0;
  for (size_t c = 0; c < m.weight.size(); ++c) sum += m.weight[c] * expected(m.component[c], f);
  return sum;
}

}  // namespace

TEST_CASE("the density of a Student-t integrates to one, and to its distribution function") {
  for (const StudentT& t : {StudentT{0.4, 0.01, 50}, StudentT{-300, 25, 3.5}, StudentT{0, 1, 1}}) {
    CHECK(expected(t, [](double) { return 1.0; }) == Approx(1).epsilon(1e-9));
    boost::math::quadrature::tanh_sinh<double> rule;
    for (double z : {-2.5, -0.3, 0.0, 1.7}) {
      const double x = t.location + z * std::sqrt(t.scale2);
      const double piece = rule.integrate([&](double at) { return pdf(t, at); }, t.location, x + 1e-300);
      CHECK(cdf(t, x) == Approx(0.5 + piece).epsilon(1e-10));
    }
  }
}

TEST_CASE("one degree of freedom is the Cauchy distribution") {
  const StudentT t{2, 9, 1};
  for (double z : {-1e12, -1e3, -1.0, 0.5, 40.0}) {
    // Towards the left atan(z)/pi + 1/2 cancels; atan(-1/z)/pi is the same number.
    const double p = z < 0 ? std::atan(-1 / z) / M_PI : 0.5 + std::atan(z) / M_PI;
    CHECK(cdf(t, 2 + 3 * z) == Approx(p).epsilon(1e-12));
  }
  CHECK(*quantile(t, 0.75) == Approx(5).epsilon(1e-13));
  CHECK(entropy(t) == Approx(std::log(4 * M_PI * 3)).epsilon(1e-13));
}

TEST_CASE("quantiles invert the distribution function, far into the tails and at few degrees of freedom") {
  for (double dof : {0.05, 0.4, 1.0, 7.0, 100.0, 2e4}) {
    const StudentT t{0.4, 0.01, dof};
    for (double p : {1e-12, 1e-3, 0.05, 0.5, 0.8, 0.999}) {
      INFO("dof " << dof << ", p " << p);
      const auto x = quantile(t, p);
      REQUIRE(x);
      CHECK(cdf(t, *x) == Approx(p).epsilon(1e-9));
    }
  }
}

TEST_CASE("a quantile beyond the largest double is empty, and so is one of a probability outside (0, 1)") {
  const StudentT heavy{0, 1, 0.004};
  CHECK_FALSE(quantile(heavy, 1e-6));
  CHECK_FALSE(quantile(heavy, 1 - 1e-6));
  CHECK(quantile(heavy, 0.5));
  CHECK_FALSE(quantile({{1.0}, {heavy}}, 1 - 1e-6));
  for (double p : {0.0, 1.0, -0.1, std::numeric_limits<double>::quiet_NaN()}) {
    CHECK_FALSE(quantile(StudentT{0, 1, 5}, p));
    CHECK_FALSE(quantile(two_materials(), p));
  }
}

TEST_CASE("mean, variance, CVaR and entropy of a Student-t are what quadrature gives") {
  const StudentT t{0.4, 0.01, 6};
  CHECK(*mean(t) == Approx(expected(t, [](double x) { return x; })).epsilon(1e-9));
  CHECK(*variance(t) == Approx(expected(t, [](double x) { return (x - 0.4) * (x - 0.4); })).epsilon(1e-7));
  CHECK(entropy(t) == Approx(expected(t, [&](double x) { return -log_pdf(t, x); })).epsilon(1e-9));
  boost::math::quadrature::tanh_sinh<double> rule;
  for (double p : {0.05, 0.5, 0.9}) {
    const double q = *quantile(t, p);
    const auto weighted = [&](double x) { return x * pdf(t, x); };
    CHECK(*cvar(t, p, Tail::upper) ==
          Approx(rule.integrate(weighted, q, std::numeric_limits<double>::infinity()) / (1 - p)).epsilon(1e-8));
    CHECK(*cvar(t, p, Tail::lower) ==
          Approx(rule.integrate(weighted, -std::numeric_limits<double>::infinity(), q) / p).epsilon(1e-8));
  }
}

TEST_CASE("moments of a mixture follow from its density") {
  const StudentTMixture m = two_materials();
  const double centre = expected(m, [](double x) { return x; });
  CHECK(*mean(m) == Approx(centre).epsilon(1e-9));
  CHECK(*variance(m) == Approx(expected(m, [&](double x) { return (x - centre) * (x - centre); })).epsilon(1e-7));
  CHECK(std::exp(log_pdf(m, 0.3)) == Approx(pdf(m, 0.3)).epsilon(1e-13));
  for (double p : {0.02, 0.29, 0.31, 0.9}) CHECK(cdf(m, *quantile(m, p)) == Approx(p).epsilon(1e-11));
  const double q = *quantile(m, 0.1);
  boost::math::quadrature::tanh_sinh<double> rule;
  const double tail =
      rule.integrate([&](double x) { return x * pdf(m, x); }, -std::numeric_limits<double>::infinity(), q);
  CHECK(*cvar(m, 0.1, Tail::lower) == Approx(tail / 0.1).epsilon(1e-7));
  CHECK(*cvar(m, 0.1, Tail::lower) < q);
  CHECK(*cvar(m, 0.1, Tail::upper) > q);
}

TEST_CASE("moments exist only where every component of some weight has the degrees of freedom for them") {
  StudentTMixture m = two_materials();
  m.component[0].dof = 2;
  CHECK(mean(m));
  CHECK_FALSE(variance(m));
  CHECK(cvar(m, 0.1, Tail::upper));
  m.component[0].dof = 1;
  CHECK_FALSE(mean(m));
  CHECK_FALSE(cvar(m, 0.1, Tail::upper));
  CHECK(quantile(m, 0.1));
  CHECK(location(m) == Approx(0.3 * 0.19 + 0.7 * 0.54));
  m.weight = {0, 1};
  CHECK(*mean(m) == 0.54);
  CHECK(variance(m));
}

TEST_CASE("moving and stretching the property moves and stretches every summary") {
  const StudentTMixture m = two_materials();
  StudentTMixture moved = m;
  for (StudentT& t : moved.component) t = {1e6 + 1000 * t.location, 1e6 * t.scale2, t.dof};
  CHECK(*quantile(moved, 0.2) - 1e6 == Approx(1000 * *quantile(m, 0.2)).epsilon(1e-9));
  CHECK(*variance(moved) == Approx(1e6 * *variance(m)).epsilon(1e-9));
  CHECK(*cvar(moved, 0.2, Tail::lower) - 1e6 == Approx(1000 * *cvar(m, 0.2, Tail::lower)).epsilon(1e-9));
  CHECK(log_pdf(moved, 1e6 + 1000 * 0.3) == Approx(log_pdf(m, 0.3) - std::log(1000)).epsilon(1e-9));
}

}  // namespace felt
