#include "inference/decision.h"

#include <algorithm>
#include <boost/math/quadrature/gauss_kronrod.hpp>
#include <boost/math/quadrature/sinh_sinh.hpp>
#include <catch2/catch.hpp>
#include <cmath>
#include <numeric>

#include "inference/information_gain.h"
#include "inference/priors.h"

namespace felt {
namespace {

StudentTMixture pair_at_distance(double d) { return {{0.5, 0.5}, {{-d / 2, 1, 50}, {d / 2, 1, 50}}}; }

// H(mixture) - sum p H(t) the plain way, by a rule that shares nothing with the product's.
double mutual_information(const StudentTMixture& m) {
  boost::math::quadrature::sinh_sinh<double> rule(13);
  double scale = 0;
  for (const StudentT& t : m.component) scale = std::max(scale, std::sqrt(t.scale2));
  const double centre = location(m);
  double information = rule.integrate([&](double z) {
    const double log_density = log_pdf(m, centre + scale * z);
    return -scale * std::exp(log_density) * log_density;
  });
  for (size_t c = 0; c < m.weight.size(); ++c) information -= m.weight[c] * entropy(m.component[c]);
  return information;
}

// P(|T - location + N(0, noise_sd^2)| >= distance): the mean of the distribution function over the noise, by panels
// that are narrow where it turns.
double convolved_tail(const StudentT& t, double distance, double noise_sd) {
  const StudentT centred{0, t.scale2, t.dof};
  const double farthest = 40, turn = distance / noise_sd, width = std::sqrt(t.scale2) / noise_sd;
  std::vector<double> edge{-farthest, farthest};
  for (int i = -10; i <= 10; ++i) edge.push_back(1.5 * i);
  for (const double centre : {-turn, turn})
    for (const double scales : {0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4})
      for (const double side : {-1.0, 1.0}) edge.push_back(centre + side * scales * width);
  std::erase_if(edge, [&](double at) { return std::abs(at) > farthest; });
  std::sort(edge.begin(), edge.end());
  double sum = 0;
  for (size_t i = 0; i + 1 < edge.size(); ++i) {
    if (edge[i] == edge[i + 1]) continue;
    sum += boost::math::quadrature::gauss_kronrod<double, 31>::integrate(
        [&](double z) {
          const double density = std::exp(-z * z / 2) / std::sqrt(2 * M_PI);
          return density * (cdf(centred, noise_sd * z - distance) + cdf(centred, -noise_sd * z - distance));
        },
        edge[i], edge[i + 1], 6, 1e-11);
  }
  return sum;
}

}  // namespace

TEST_CASE("a touch tells nothing about classes that feel the same, and everything about classes far apart") {
  const Estimate same = information_gain(pair_at_distance(0)), apart = information_gain(pair_at_distance(1000));
  CHECK(std::abs(same.value) < 1e-12);
  CHECK(std::abs(apart.value - std::log(2)) < 1e-9);
}

TEST_CASE("information gain agrees with the difference of entropies within its own error estimate") {
  const StudentTMixture materials{{0.2, 0.5, 0.3}, {{0.19, 0.0021, 50}, {0.54, 0.0042, 7}, {0.39, 0.005, 2.5}}};
  for (const StudentTMixture& m : {pair_at_distance(0.3), pair_at_distance(2), materials}) {
    const Estimate gain = information_gain(m);
    INFO(gain.value << " +- " << gain.error);
    CHECK(gain.error < 1e-6);
    CHECK(std::abs(gain.value - mutual_information(m)) < gain.error + 1e-9);
    const Estimate differential = entropy(m);
    double within = 0;
    for (size_t c = 0; c < m.weight.size(); ++c) within += m.weight[c] * entropy(m.component[c]);
    CHECK(std::abs(differential.value - within - gain.value) < gain.error + differential.error + 1e-9);
    CHECK(gain.value < class_entropy(m.weight));
  }
}

TEST_CASE("what doubles do not resolve has no claimed accuracy, and no gain is more than there is to learn") {
  for (const double sd : {1e-17, 1e-20}) {
    StudentTMixture m;
    m.weight = {0.5, 0.5};
    for (const double at : {0.4, 0.5}) m.component.push_back({at, sd * sd, 100});
    const Estimate gain = information_gain(m);
    CHECK(std::isinf(gain.error));
    CHECK(gain.value >= 0);
    CHECK(gain.value <= std::log(2.0) * (1 + 1e-15));
    CHECK(std::isinf(entropy(m).error));
  }
}

TEST_CASE("the entropy of a lone component is its closed form, also with heavy tails") {
  for (double dof : {0.2, 1.0, 4.0, 200.0}) {
    const StudentT t{-300, 25, dof};
    const Estimate estimate = entropy(StudentTMixture{{1}, {t}});
    INFO("dof " << dof << ": " << estimate.value << " +- " << estimate.error);
    CHECK(estimate.error < 1e-5);
    CHECK(std::abs(estimate.value - entropy(t)) < estimate.error + 1e-9);
  }
}

TEST_CASE("components of very different widths do not escape the quadrature") {
  const StudentTMixture m{{0.5, 0.5}, {{0.4, 1e-12, 50}, {0.4, 1, 50}}};
  const Estimate gain = information_gain(m);
  // The narrow one hides nothing: only its own density counts within its width.
  CHECK(gain.value == Approx(std::log(2)).epsilon(1e-4));
  CHECK(gain.value < std::log(2));
}

TEST_CASE("class entropy is zero for certainty and ln k for ignorance") {
  CHECK(class_entropy(std::vector<double>{0, 1, 0}) == 0);
  CHECK(class_entropy(std::vector<double>(8, 0.125)) == Approx(std::log(8)));
  CHECK(most_probable_class(std::vector<double>{0.2, 0.4, 0.4}) == 1);
}

TEST_CASE("a belief floor leaves no class below it and keeps the sum") {
  std::vector<double> belief{1e-9, 3e-6, 0.4, 1.6};
  apply_belief_floor(belief, 1e-6);
  CHECK(std::accumulate(belief.begin(), belief.end(), 0.0) == Approx(2.000003001).epsilon(1e-12));
  for (double x : belief) CHECK(x >= 1e-6 * 2.000003);
  CHECK(belief[3] / belief[2] == Approx(4).epsilon(1e-12));
}

TEST_CASE("a mode is where the density has its maximum, between the points that were looked at") {
  const StudentTMixture m{{0.7, 0.3}, {{0.0, 1.0, 8}, {1.2, 2.0, 8}}};
  const std::vector<double> found = modes(m);
  REQUIRE(found.size() == 1);
  CHECK(found[0] > 0.01);
  for (const double step : {1e-4, 1e-3, 1e-2}) {
    CHECK(pdf(m, found[0]) > pdf(m, found[0] - step));
    CHECK(pdf(m, found[0]) > pdf(m, found[0] + step));
  }
}

TEST_CASE("two humps count as two modes only when a dip parts them") {
  CHECK(modes(pair_at_distance(1)).size() == 1);
  CHECK(modes(pair_at_distance(2.1)).size() == 1);
  const std::vector<double> parted = modes(pair_at_distance(6));
  REQUIRE(parted.size() == 2);
  CHECK(parted[0] == Approx(-3).margin(0.13));
  CHECK(parted[1] == Approx(3).margin(0.13));
  // A hump below a twentieth of the highest does not matter.
  CHECK(modes({{0.97, 0.03}, {{-3, 1, 50}, {3, 1, 50}}}).size() == 1);
}

TEST_CASE("a reading that no class explains is surprising; in a mixed region it warns of several materials") {
  const StudentTMixture mixed = pair_at_distance(6), sure{{1.0}, {{3, 1, 50}}};
  CHECK(tail_probability(sure, 3, 0) == Approx(1));
  CHECK_FALSE(region_flags(mixed, 2.5, 0).surprising);
  CHECK(region_flags(mixed, 2.5, 0).multi_modal);
  CHECK(region_flags(mixed, 12, 0).not_one_material);
  CHECK(region_flags(sure, 12, 0).surprising);
  CHECK_FALSE(region_flags(sure, 12, 0).not_one_material);
  const RegionFlags noisy = region_flags(mixed, 12, 8);
  CHECK_FALSE(noisy.surprising);
  CHECK_FALSE(noisy.not_one_material);
  CHECK(noisy.multi_modal);  // of what is there, not of how well it is measured
}

TEST_CASE("the tail of a noisy reading is that of the Student-t convolved with the noise") {
  double worst = 0;
  for (const double dof : {0.07, 1.0, 3.0, 50.0, 1e6})
    for (const double noise_sd : {1e-3, 0.1, 0.5, 1.0, 3.0, 100.0})
      for (const double z : {0.0, 0.3, 1.0, 3.0, 6.0}) {
        const StudentT t{-2, 4, dof};
        const double sd = 2 * noise_sd, distance = z * std::hypot(2, sd);
        const double found = tail_probability({{1}, {t}}, t.location + distance, sd);
        const double expected = convolved_tail(t, distance, sd);
        INFO("dof " << dof << ", noise " << noise_sd << " scales, z " << z << ": " << found << ", " << expected);
        CHECK(found == Approx(expected).epsilon(1e-8).margin(0));
        worst = std::max(worst, std::abs(found / expected - 1));
      }
  INFO("largest relative error " << worst);
  CHECK(worst < 1e-8);
}

TEST_CASE("the more noise a reading has the less it surprises, and without noise the tail is the distribution's") {
  const StudentTMixture mixed{{0.2, 0.5, 0.3}, {{0.19, 0.0021, 50}, {0.54, 0.0042, 7}, {0.39, 0.005, 2.5}}};
  double last = 0;
  for (size_t c = 0; c < 3; ++c)
    last += mixed.weight[c] * 2 * cdf(mixed.component[c], 2 * mixed.component[c].location - 1.2);
  CHECK(tail_probability(mixed, 1.2, 0) == Approx(last).epsilon(1e-12));
  CHECK(tail_probability(mixed, 1.2, 1e-9) == Approx(last).epsilon(1e-7));
  for (const double noise_sd : {0.03, 0.1, 0.3, 1.0, 3.0, 1000.0}) {
    const double tail = tail_probability(mixed, 1.2, noise_sd);
    CHECK(tail > last);
    last = tail;
  }
  CHECK(last == Approx(1).epsilon(1e-3));
}

TEST_CASE("the published initialisation is refused where the mean is not positive") {
  CHECK_FALSE(published_prior(-20, 3));
  CHECK_FALSE(published_prior(0, 3));
  const auto rock = published_prior(0.478, 0.133), plastic = published_prior(0.311, 0.045);
  REQUIRE((rock && plastic));
  // What it does to the table's variance: 7 to 177 times, rock to rubber.
  CHECK(plug_in_variance(*rock) / (0.133 * 0.133) == Approx(7.35).epsilon(0.01));
  CHECK(plug_in_variance(*published_prior(0.616, 0.048)) / (0.048 * 0.048) == Approx(177).epsilon(0.01));
}

TEST_CASE("a calibrated prior predicts the table's mean and nearly its spread") {
  const Nig ice = calibrated_prior(0.192, 0.046);
  const StudentT t = predictive(ice);
  CHECK(*mean(t) == 0.192);
  CHECK(plug_in_variance(ice) == Approx(0.046 * 0.046));
  CHECK(std::sqrt(*variance(t)) == Approx(0.046).epsilon(0.04));
}

TEST_CASE("classes without a prior leave the predictive to the others") {
  const std::vector<Nig> nig{calibrated_prior(0.2, 0.05), Nig{}, calibrated_prior(0.5, 0.05)};
  const StudentTMixture m = predictive_mixture(std::vector<double>{1, 7, 3}, nig);
  CHECK(m.weight == std::vector<double>{0.25, 0.75});
  CHECK(plug_in_mixture(std::vector<double>{1, 7, 3}, nig)[1].mean == 0.5);
}

}  // namespace felt
