#include "io/simulation/label_network.h"

#include <tbb/global_control.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <set>

#include "core/error.h"
#include "io/simulation/furniture.h"
#include "io/simulation/scene_library.h"
#include "io/simulation/sequence_writer.h"
#include "io/tables/confusion_file.h"

using namespace felt;

namespace {

/// Every class of the table, each in a column of its own, the whole height one instance.
struct LabelledImage {
  LabelImage labels;
  Image<uint16_t> instances;
};
LabelledImage one_column_a_class(const ClassTable& classes, int height) {
  LabelledImage image{LabelImage(classes.size(), height), Image<uint16_t>(classes.size(), height)};
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < classes.size(); ++u)
      image.labels(u, v) = classes.at_slot(u).id, image.instances(u, v) = uint16_t(u + 1);
  return image;
}

/// Share of every prediction for every true class, and its largest distance from the matrix in standard errors.
double worst_deviation(const LabelNetwork& network, const ClassTable& classes, int frames, int height, int draws) {
  const LabelledImage truth = one_column_a_class(classes, height);
  const int k = classes.size();
  std::vector<double> counts(size_t(k) * k, 0.0);
  for (int frame = 0; frame < frames; ++frame) {
    const NetworkOutput output = run_network(network, classes, truth.labels, truth.instances, 11, frame);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < k; ++u) counts[size_t(u) * k + classes.slot_of_id(output.labels(u, v))] += 1;
  }
  double worst = 0;
  for (int i = 0; i < k; ++i)
    for (int j = 0; j < k; ++j) {
      const double p = network.confusion(i, j), share = counts[size_t(i) * k + j] / (double(frames) * height);
      worst = std::max(worst, std::abs(share - p) / std::sqrt(std::max(p * (1 - p), 1e-4) / draws));
    }
  return worst;
}

}  // namespace

TEST_CASE("predicted labels reproduce the confusion matrix at every scale of errors") {
  const ClassTable classes = simulated_materials();
  for (const char* preset : preset_confusion_names()) {
    LabelNetwork network{preset_confusion(preset, classes)};
    INFO(preset);
    // The largest of 225 deviations of normal size: beyond 5 happens once in some 8000 runs of a right network.
    network.scale = ErrorScale::pixel;
    CHECK(worst_deviation(network, classes, 4, 5000, 20000) < 5);
    network.scale = ErrorScale::segment;
    CHECK(worst_deviation(network, classes, 20000, 1, 20000) < 5);
  }
}

TEST_CASE("errors of a segment are shared by its pixels, errors of a scene by its frames") {
  const ClassTable classes = simulated_materials();
  const LabelledImage truth = one_column_a_class(classes, 50);
  LabelNetwork network{preset_confusion("poor", classes)};
  const auto labels_of = [&](int64_t frame) {
    return run_network(network, classes, truth.labels, truth.instances, 1, frame).labels;
  };
  const auto uniform_columns = [&](const LabelImage& labels) {
    int uniform = 0;
    for (int u = 0; u < labels.width(); ++u) {
      std::set<uint16_t> seen;
      for (int v = 0; v < labels.height(); ++v) seen.insert(labels(u, v));
      uniform += seen.size() == 1;
    }
    return uniform;
  };
  network.scale = ErrorScale::pixel;
  CHECK(uniform_columns(labels_of(0)) == 0);
  network.scale = ErrorScale::segment;
  CHECK(uniform_columns(labels_of(0)) == classes.size());
  CHECK(labels_of(0) != labels_of(1));
  network.scale = ErrorScale::scene;
  CHECK(uniform_columns(labels_of(0)) == classes.size());
  CHECK(labels_of(0) == labels_of(1));
}

TEST_CASE("class probabilities are calibrated when not sharpened, and sorted") {
  const ClassTable classes = simulated_materials();
  const int k = classes.size();
  LabelNetwork network{preset_confusion("medium", classes), ErrorScale::pixel, k};
  const LabelledImage truth = one_column_a_class(classes, 20000);
  const NetworkOutput output = run_network(network, classes, truth.labels, truth.instances, 5, 0);
  REQUIRE(output.probabilities.top == k);
  // Among pixels with one prediction (and so one vector of probabilities) each class is true as often as stated.
  std::vector<double> stated(size_t(k) * k, 0.0), happened(size_t(k) * k, 0.0), times(k, 0.0);
  for (int v = 0; v < 20000; ++v) {
    for (int u = 0; u < k; ++u) {
      const size_t pixel = size_t(v) * k + u;
      const int predicted = classes.slot_of_id(output.labels.data()[pixel]);
      float last = 1, sum = 0;
      for (int r = 0; r < k; ++r) {
        const float p = output.probabilities.probability[pixel * k + r];
        REQUIRE(p <= last);
        last = p, sum += p;
        stated[size_t(predicted) * k + classes.slot_of_id(output.probabilities.class_id[pixel * k + r])] = p;
      }
      REQUIRE(sum == Approx(1));
      happened[size_t(predicted) * k + u] += 1;
      times[predicted] += 1;
    }
  }
  for (int j = 0; j < k; ++j)
    for (int i = 0; i < k; ++i) {
      const double p = stated[size_t(j) * k + i];
      CHECK(happened[size_t(j) * k + i] / times[j] == Approx(p).margin(5 * std::sqrt(std::max(p, 1e-4) / times[j])));
    }

  network.sharpness = 3;
  const NetworkOutput sharp = run_network(network, classes, truth.labels, truth.instances, 5, 0);
  CHECK(sharp.labels == output.labels);
  CHECK(sharp.probabilities.probability[0] > output.probabilities.probability[0]);
}

TEST_CASE("ignored and unknown pixels stay without a label, and threads do not matter") {
  const ClassTable classes = simulated_materials();
  LabelledImage truth = one_column_a_class(classes, 3000);
  truth.labels(2, 2) = 0;
  truth.labels(3, 2) = 999;
  const LabelNetwork network{preset_confusion("poor", classes), ErrorScale::pixel, 3};
  const auto run = [&](int threads) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, size_t(threads));
    return run_network(network, classes, truth.labels, truth.instances, 1, 4);
  };
  const NetworkOutput one = run(1), two = run(2);
  CHECK(one.labels == two.labels);
  CHECK(one.probabilities.probability == two.probabilities.probability);
  CHECK(one.labels(2, 2) == 0);
  CHECK(one.labels(3, 2) == 0);
  CHECK(one.probabilities.probability[(2 * size_t(classes.size()) + 2) * 3] == 0);
}

TEST_CASE("the presets rank as their names say and ice is mistaken for snow more than for anything else") {
  const ClassTable classes = simulated_materials();
  const int ice = *classes.slot_of_name("ice"), snow = *classes.slot_of_name("snow");
  double last = 1;
  for (const char* preset : preset_confusion_names()) {
    const ConfusionMatrix confusion = preset_confusion(preset, classes);
    double right = 0;
    for (int i = 0; i < confusion.k; ++i) {
      right += confusion(i, i) / confusion.k;
      for (int j = 0; j < confusion.k; ++j) CHECK(confusion(i, i) >= confusion(i, j));
    }
    CHECK(right < last);
    last = right;
    for (int j = 0; j < confusion.k; ++j)
      if (j != ice && j != snow) CHECK(confusion(ice, j) < confusion(ice, snow));
  }
  CHECK_THROWS_AS(preset_confusion("perfect", classes), ConfigError);
}

TEST_CASE("a confusion matrix survives its file, in any order of rows and columns") {
  const ClassTable classes = simulated_materials();
  const ConfusionMatrix confusion = preset_confusion("poor", classes);
  const ConfusionMatrix read = parse_confusion_matrix(confusion_csv(confusion, classes), classes, "test");
  for (size_t i = 0; i < confusion.p.size(); ++i) CHECK(read.p[i] == Approx(confusion.p[i]).epsilon(1e-15));

  const ClassTable two({{0, "none", {}, true}, {1, "ice", {}}, {2, "snow", {}}});
  const ConfusionMatrix counts = parse_confusion_matrix("x,snow,ice\r\nsnow,3,1\n\nice,0,5\n", two, "counts.csv");
  CHECK(counts(0, 0) == 1);
  CHECK(counts(1, 0) == 0.25);
  CHECK(counts(1, 1) == 0.75);
}

TEST_CASE("a faulty confusion matrix is refused with its first fault, and how many more there are") {
  const ClassTable two({{0, "none", {}, true}, {1, "ice", {}}, {2, "snow", {}}});
  const auto message = [&](const std::string& text) -> std::string {
    try {
      parse_confusion_matrix(text, two, "m.csv");
    } catch (const ConfigError& e) {
      return e.what();
    }
    return "accepted";
  };
  CHECK(message("") == "m.csv: rows: expected every class, found none for 'ice', 'snow'");
  CHECK(message("x,ice\nice,1\nsnow,1\n") == "m.csv:1: columns: expected every class, found none for 'snow'");
  CHECK(message("x;ice;snow\nice;1;a\nsnow;1\n") ==
        "m.csv:2: number 2: expected a finite number >= 0, found 'a' (and 2 more faults)");
  CHECK(message("x,ice,snow\nice,1,0\nice,1,0\nfog,1,1\n") ==
        "m.csv:3: true class: expected each class once, found 'ice' again (and 2 more faults)");
  CHECK(message("x,ice,snow\nice,-1,2\nsnow,0,nan\n") ==
        "m.csv:2: number 1: expected a finite number >= 0, found '-1' (and 1 more fault)");
  CHECK_THAT(message("x,ice,snow\nice,1,2\nsnow,0,0\n"), Catch::Contains("row 2"));
}

TEST_CASE("of many classes that a confusion matrix lacks the first few are named") {
  const ClassTable five({{1, "a", {}}, {2, "b", {}}, {3, "c", {}}, {4, "d", {}}, {5, "e", {}}});
  CHECK_THROWS_WITH(
      parse_confusion_matrix("\xef\xbb\xbfx;a\n", five, "m.csv"),
      Catch::StartsWith("m.csv:1: columns: expected every class, found none for 'b', 'c', 'd' and 1 more (and"));
}

TEST_CASE("class shares are the shares of the pixels") {
  const Scene scene = make_scene("ice_crossing");
  const Trajectory trajectory = standard_trajectory(scene, 8);
  const auto shares = class_shares(scene, trajectory, simulated_camera(), LabelSet::material);
  double counted = 0, ice = 0, sum = 0;
  for (const auto& T : trajectory)
    for (const uint16_t id : render_view(scene, simulated_camera(160, 120), T, false).materials)
      counted += id != 0, ice += id == kIce;
  for (const double share : shares) sum += share;
  CHECK(sum == Approx(1));
  CHECK(shares[*scene.materials.slot_of_name("ice")] == Approx(ice / counted).margin(0.01));
}
