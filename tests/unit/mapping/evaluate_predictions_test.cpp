#include "mapping/evaluation/evaluate_predictions.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <random>

using namespace felt;

TEST_CASE("accuracy, recall, precision and IoU follow from the counts") {
  LabelCounts m(3);
  const int counts[2][4] = {{6, 2, 0, 2}, {1, 3, 0, 0}};  // class 2 never occurs; the last column: no prediction
  for (int t = 0; t < 2; ++t)
    for (int p = 0; p < 4; ++p)
      for (int n = 0; n < counts[t][p]; ++n) m.add(t, p < 3 ? p : -1);
  m.add(7, 0);  // no such class in the truth: not counted
  CHECK(m.total() == 14);
  CHECK(m.without_prediction(0) == 2);
  CHECK(m.pixel_accuracy() == Approx(9 / 14.0));
  CHECK(m.recall(0) == Approx(0.6));
  CHECK(m.precision(0) == Approx(6 / 7.0));
  CHECK(m.iou(0) == Approx(6 / 11.0));
  CHECK(m.iou(1) == Approx(3 / 6.0));
  CHECK(std::isnan(m.recall(2)));
  CHECK(std::isnan(m.iou(2)));
  CHECK(m.mean_iou() == Approx((6 / 11.0 + 0.5) / 2));
  CHECK(m.mean_iou_of_all() == Approx((6 / 11.0 + 0.5) / 2));
  LabelCounts twice = m;
  twice += m;
  CHECK(twice.total() == 28);
  CHECK(twice.iou(0) == m.iou(0));
  m.add(0, 2);  // class 2 is predicted now, and never right
  CHECK(m.mean_iou() == Approx((6 / 12.0 + 0.5) / 2));
  CHECK(m.mean_iou_of_all() == Approx((6 / 12.0 + 0.5) / 3));
  CHECK(m.count(0, 2) == 1);
  m = twice;
  CHECK(m.mean_recall() == Approx((0.6 + 0.75) / 2));
  CHECK(std::isnan(LabelCounts(2).pixel_accuracy()));
}

TEST_CASE("forecasts that are right as often as they say have no calibration error, boastful ones have") {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(0, 1);
  CalibrationScores honest, boastful;
  for (int i = 0; i < 60000; ++i) {
    const double p = 0.5 + 0.5 * u(random);
    const int truth = u(random) < p ? 0 : 1;
    const double said[2] = {p, 1 - p}, shout[2] = {0.99, 0.01};
    honest.add(said, truth);
    boastful.add(shout, truth);
  }
  CHECK(honest.ece() < 0.01);
  CHECK(boastful.ece() == Approx(0.99 - 0.75).margin(0.01));
  CHECK(honest.nll() < boastful.nll());
  CHECK(honest.brier() < boastful.brier());
}

TEST_CASE("calibration scores of three forecasts are those worked out by hand") {
  CalibrationScores s;
  s.add(std::array{0.7, 0.2, 0.1}, 0);
  s.add(std::array{0.7, 0.2, 0.1}, 1);
  s.add(std::array{0.0, 1.0, 0.0}, 1);
  // One bin holds 0.7 twice, once right; another 1.0 once, right.
  CHECK(s.ece() == Approx(std::abs(1.4 - 1) / 3));
  CHECK(s.brier() == Approx((0.09 + 0.04 + 0.01 + 0.49 + 0.64 + 0.01) / 3));
  CHECK(s.nll() == Approx((-std::log(0.7) - std::log(0.2)) / 3));
  CHECK(s.bins()[10].count == 2);
  CHECK(s.bins()[14].count == 1);
  s.add(std::array{0.7, 0.7, 0.1}, 0);
  s.add(std::array<double, 3>{NAN, 0.7, 0.3}, 0);
  s.add(std::array{0.5, 0.5, 0.0}, 3);
  CHECK(s.count() == 3);
  CHECK(s.refused() == 3);
}

TEST_CASE("property scores of normal forecasts are those of the closed form") {
  // CRPS of N(0, 1) at y: y (2 Phi(y) - 1) + 2 phi(y) - 1 / sqrt(pi) (Gneiting et al. 2005).
  std::vector<double> quantiles;
  for (int i = 0; i < 999; ++i) {
    // Inverse of the normal distribution function by bisection.
    double low = -8, high = 8;
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + high);
      (0.5 * std::erfc(-middle / std::sqrt(2)) < (i + 0.5) / 999 ? low : high) = middle;
    }
    quantiles.push_back(low);
  }
  for (const double y : {0.0, 0.7, -2.5}) {
    PropertyScores s;
    s.add(y, 0, -1.5, quantiles);
    const double phi = std::exp(-y * y / 2) / std::sqrt(2 * M_PI), cdf = 0.5 * std::erfc(-y / std::sqrt(2));
    CHECK(s.crps() == Approx(y * (2 * cdf - 1) + 2 * phi - 1 / std::sqrt(M_PI)).epsilon(0.005));
    CHECK(s.mae() == Approx(std::abs(y)));
    CHECK(s.nll() == 1.5);
  }
  PropertyScores many;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 20000; ++i) many.add(normal(random), 0, 0, quantiles);
  CHECK(many.coverage(0) == Approx(0.5).margin(0.015));
  CHECK(many.coverage(1) == Approx(0.9).margin(0.01));
}

TEST_CASE("image metrics of known images") {
  Image<float> a(32, 24), b(32, 24), flat(32, 24, 0.5f), shifted(32, 24, 0.6f);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> u(0, 1);
  for (size_t i = 0; i < a.size(); ++i) a.data()[i] = u(random), b.data()[i] = 1 - a.data()[i];
  CHECK(std::isinf(psnr_db(a, a)));
  CHECK(psnr_db(flat, shifted) == Approx(20).epsilon(1e-5));
  CHECK(ssim(a, a) == Approx(1));
  CHECK(ssim(a, b) < -0.5);
  // Without variance only the luminance term is left.
  CHECK(ssim(flat, shifted) == Approx((2 * 0.5 * 0.6 + 1e-4) / (0.25 + 0.36 + 1e-4)).epsilon(1e-4));
  CHECK(std::isnan(ssim(Image<float>(10, 30), Image<float>(10, 30))));
  Image<float> truth(2, 1), said(2, 1, 0.25f);
  truth(0, 0) = 1;
  CHECK(binary_cross_entropy(said, truth) == Approx(-0.5 * (std::log(0.25) + std::log(0.75))));
  said(0, 0) = 0;
  CHECK(std::isfinite(binary_cross_entropy(said, truth)));
}
