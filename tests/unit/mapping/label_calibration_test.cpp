#include "mapping/labels/label_calibration.h"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "core/error.h"
#include "tests/support/labelled_map.h"

using namespace felt;
using namespace felt::test;

TEST_CASE("what was learned on some pixels is scored on others, by hand") {
  ConfusionCounts learned(2), held_out(2);
  learned.pixels = {8, 2, 1, 9};
  held_out.pixels = {6, 4, 2, 8};
  const ConfusionScores s = score_confusion(learned, held_out);
  // P(true | predicted) by column: (8, 1) / 9 and (2, 9) / 11.
  CHECK(s.accuracy == Approx(14 / 20.0));
  CHECK(s.ece == Approx((std::abs(8 * 8 / 9.0 - 6) + std::abs(12 * 9 / 11.0 - 8)) / 20));
  CHECK(s.brier == Approx((6 * 2 / 81.0 + 2 * 128 / 81.0 + 4 * 162 / 121.0 + 8 * 8 / 121.0) / 20));
  CHECK(
      s.nll ==
      Approx(-(6 * std::log(8 / 9.0) + 2 * std::log(1 / 9.0) + 4 * std::log(2 / 11.0) + 8 * std::log(9 / 11.0)) / 20));
}

TEST_CASE("labels and probabilities are counted in the row of the true class") {
  const ClassTable classes = class_table({"wall", "floor", "sofa"});  // ids 1, 2, 3; 0 is ignored
  Frame frame;
  frame.labels = LabelImage(4, 1);
  LabelImage truth(4, 1);
  for (const auto& [u, predicted, actual] : {std::array{0, 1, 2}, {1, 3, 3}, {2, 0, 1}, {3, 1, 0}})
    frame.labels(u, 0) = uint16_t(predicted), truth(u, 0) = uint16_t(actual);
  ConfusionCounts hard(3);
  count_confusion(frame, truth, classes, hard);
  CHECK(hard.pixels == std::vector<double>{0, 0, 0, 1, 0, 0, 0, 0, 1});
  CHECK(hard.without_prediction == 1);
  CHECK(hard.without_truth == 1);

  Frame soft;
  soft.probabilities = {1, 1, 2, {1, 2}, {0.7f, 0.2f}};
  ConfusionCounts counts(3);
  count_confusion(soft, LabelImage(1, 1, 2), classes, counts);
  CHECK(counts.at(1, 0) == Approx(0.7));
  CHECK(counts.at(1, 1) == Approx(0.2));
  CHECK(counts.total() == Approx(0.9));
  CHECK(counts.correct() == Approx(0.2));
  CHECK(counts.without_prediction == Approx(0.1));
  counts += hard;
  CHECK(counts.at(1, 0) == Approx(1.7));
  CHECK(counts.without_prediction == Approx(1.1));
  CHECK(counts.without_truth == 1);
  CHECK_THROWS_AS(count_confusion(soft, truth, classes, counts), FormatError);
}
