// Many separate patches of floor in one map, each touched once: how often the touched label is right.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "bench/paper/friction_table.h"
#include "inference/decision.h"
#include "io/tables/property_yaml.h"
#include "mapping/touch/touch_update.h"
#include "tests/support/data.h"
#include "tests/support/labelled_map.h"

using namespace felt;
using namespace felt::test;

namespace {

constexpr double kVoxel = 0.02;
constexpr int kPatch = 6, kPitch = 10;  // voxels

/// Patches in rows of 40, patch i labelled `seen[i]` with `counts` observations; nothing between them.
Map patches(const ClassTable& classes, const std::vector<int>& seen, float counts) {
  Map map(kVoxel, 4 * kVoxel);
  map.classes = classes;
  for (size_t i = 0; i < seen.size(); ++i)
    for (int x = 0; x < kPatch; ++x)
      for (int y = 0; y < kPatch; ++y)
        for (int z = -3; z <= 3; ++z) {
          const Index3 v{int(i % 40) * kPitch + x, int(i / 40) * kPitch + y, z};
          Block& block = map.store[map.store.find_or_create(block_of_voxel(v))];
          block.geometry->tsdf[offset_in_block(v)] = float(z * kVoxel);
          block.geometry->weight[offset_in_block(v)] = 5;
          add_evidence(map, v, seen[i], counts);
        }
  return map;
}

Index3 middle(size_t i) { return {int(i % 40) * kPitch + kPatch / 2, int(i / 40) * kPitch + kPatch / 2, 0}; }

void touch(Map& map, size_t i, double value) {
  TouchRequest request;
  const Index3 v = middle(i);
  request.stamp_s = double(i);
  request.point_m = Eigen::Vector3d(v.x, v.y, v.z) * kVoxel;
  request.property = "friction";
  request.value = value;
  add_touch(map, resolve_touch(map, request));
}

}  // namespace

TEST_CASE("touched labels are right as often as the exact posterior decision, in every patch the same") {
  // Vision is right in 78 % of patches and says so: (1 + n) / (8 + n) = 0.78. One reading from Table I each, rho 0.
  const PropertyTable table = read_properties(felt::test::source_dir().string() + "/data/properties.yaml");
  Property friction = table[0];
  friction.rho = 0;
  std::vector<std::string> names;
  for (const auto& [name, prior] : friction.priors) names.push_back(name);
  const double accuracy = 0.78;
  const float counts = float((8 * accuracy - 1) / (1 - accuracy));
  std::mt19937 rng(11);
  std::vector<int> truth, seen;
  for (int i = 0; i < 800; ++i) {
    truth.push_back(int(rng() % 8));
    const bool right = std::uniform_real_distribution<double>()(rng) < accuracy;
    seen.push_back(right ? truth.back() : int((size_t(truth.back()) + 1 + rng() % 7) % 8));
  }
  Map map = patches(class_table(names), seen, counts);
  map.properties = PropertyTable({friction});
  std::vector<double> readings;
  for (size_t i = 0; i < truth.size(); ++i) {
    const PropertyPrior& prior = friction.priors.at(names[size_t(truth[i])]);
    readings.push_back(std::max(0.0, std::normal_distribution<double>(prior.mean, prior.sd)(rng)));
    touch(map, i, readings.back());
  }
  Beliefs beliefs(map);
  int seen_right = 0, touched_right = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    // The exact decision, from the printed formulas alone: belief times Student-t of 50 degrees of freedom.
    std::vector<double> score;
    for (int c = 0; c < 8; ++c) {
      const PropertyPrior& prior = friction.priors.at(names[size_t(c)]);
      const double z = (readings[i] - prior.mean) / (prior.sd * std::sqrt(51.0 / 50));
      score.push_back((c == seen[i] ? accuracy : (1 - accuracy) / 7) * std::pow(1 + z * z / 50, -25.5) / prior.sd);
    }
    const int label = most_probable_class(beliefs.at(middle(i)).class_probability);
    REQUIRE(label == most_probable_class(score));
    seen_right += seen[i] == truth[i];
    touched_right += label == truth[i];
  }
  // The optimum of this protocol is 0.830 (600,000 regions); three standard errors of 800 patches.
  CHECK(touched_right / 800.0 == Approx(0.830).margin(0.04));
  CHECK(touched_right > seen_right);
}

TEST_CASE("three touches of a patch bring labels to the optimum, also where vision's own error is not known") {
  Property friction = read_properties(felt::test::source_dir().string() + "/data/properties.yaml")[0];
  friction.rho = 0;
  std::vector<std::string> names;
  for (const paper::Material& m : paper::kMaterials) names.emplace_back(m.name);
  std::mt19937 rng(3);
  // Shares of right labels by class after 0, 1, 2, 3 touches, each patch touched at its middle.
  const auto shares_right = [&](const std::vector<int>& truth, const std::vector<int>& seen, float counts) {
    Map map = patches(class_table(names), seen, counts);
    map.properties = PropertyTable({friction});
    std::vector<std::array<double, 8>> shares;
    for (int touches = 0; touches <= 3; ++touches) {
      std::array<double, 8> right{}, of{};
      if (touches > 0) {
        for (size_t i = 0; i < truth.size(); ++i) {
          const paper::Material& m = paper::kMaterials[size_t(truth[i])];
          touch(map, i, std::max(0.0, std::normal_distribution<double>(m.mean, m.sd)(rng)));
        }
      }
      Beliefs beliefs(map);
      for (size_t i = 0; i < truth.size(); ++i) {
        const size_t c = size_t(truth[i]);
        of[c] += 1;
        right[c] += most_probable_class(beliefs.at(middle(i)).class_probability) == truth[i];
      }
      for (size_t c = 0; c < 8; ++c) right[c] /= of[c];
      shares.push_back(right);
    }
    return shares;
  };
  const auto macro = [](const auto& share_of) {
    double sum = 0;
    for (size_t c = 0; c < 8; ++c) sum += share_of(c);
    return sum / 8;
  };

  // Touched anywhere, vision right in 39 of 50 patches of each class and saying so; wrong labels are each as likely.
  // The optimum of 600,000 regions: 0.78, 0.830, 0.863, 0.884.
  std::vector<int> truth, seen;
  for (int c = 0; c < 8; ++c)
    for (int i = 0; i < 50; ++i) truth.push_back(c), seen.push_back(i < 39 ? c : (c + 1 + i % 7) % 8);
  const auto anywhere = shares_right(truth, seen, float((8 * 0.78 - 1) / (1 - 0.78)));
  const double optimum[] = {0.78, 0.830, 0.863, 0.884};
  for (size_t n = 0; n < 4; ++n) {
    INFO(n << " touches");
    CHECK(macro([&](size_t c) { return anywhere[n][c]; }) == Approx(optimum[n]).margin(0.02));
  }

  // The published protocol: touched only where vision is wrong, each label seen once. Patches are only those.
  truth.clear(), seen.clear();
  for (int c = 0; c < 8; ++c)
    for (int i = 0; i < 42; ++i) truth.push_back(c), seen.push_back((c + 1 + i % 7) % 8);
  const auto corrected = shares_right(truth, seen, 1);
  const auto published = [&](size_t n) {
    return macro([&](size_t c) {
      const double accuracy = paper::kMaterials[c].vision_accuracy;
      return accuracy + (1 - accuracy) * corrected[n][c];
    });
  };
  CHECK(published(1) == Approx(0.863).margin(0.01));
  CHECK(published(3) == Approx(0.914).margin(0.01));
}

TEST_CASE("measured friction of eight materials, priors from two thirds of it, corrects labels and predictions") {
  FELTMAP_REQUIRE_DATA(folder, "smdra_friction");
  struct Reading {
    int image;
    std::string material;
    double value;
  };
  std::vector<Reading> readings;
  std::ifstream csv(folder / "friction_measurements.csv");
  std::string line;
  std::getline(csv, line);
  while (std::getline(csv, line)) {
    std::istringstream cells(line);
    std::string image, label, material, value;
    std::getline(cells, image, ','), std::getline(cells, label, ',');
    std::getline(cells, material, ','), std::getline(cells, value, ',');
    std::replace_if(
        material.begin(), material.end(), [](char c) { return c == ' ' || c == '/'; }, '_');
    readings.push_back({std::stoi(image), material, std::stod(value)});
  }
  REQUIRE(readings.size() == 392);
  // Images divisible by three are touched, the others give the priors. Each holds a material once: there are no groups
  // to fit rho from, so it keeps its default.
  std::map<std::string, std::vector<double>> train, test;
  for (const Reading& r : readings) (r.image % 3 == 0 ? test : train)[r.material].push_back(r.value);
  Property friction;
  friction.name = "friction";
  friction.support_lo = 0;
  std::vector<std::string> names;
  for (const auto& [material, values] : train) {
    const ReadingStatistics s = statistics_of(values);
    friction.priors[material] = {s.mean, std::sqrt(s.m2 / (s.n - 1)), s.n};
    names.push_back(material);
  }
  REQUIRE(names.size() == 8);
  std::mt19937 rng(5);
  std::vector<Reading> touched;
  for (const Reading& r : readings)
    if (r.image % 3 == 0) touched.push_back(r);
  // Vision that is right in 70 % of patches and says so.
  std::vector<int> truth, seen;
  for (const Reading& r : touched) {
    truth.push_back(int(std::find(names.begin(), names.end(), r.material) - names.begin()));
    const bool right = std::uniform_real_distribution<double>()(rng) < 0.7;
    seen.push_back(right ? truth.back() : int((size_t(truth.back()) + 1 + rng() % 7) % 8));
  }
  Map map = patches(class_table(names), seen, float((8 * 0.7 - 1) / 0.3));
  map.properties = PropertyTable({friction});
  // Error of the prediction of the material's other readings in the images that are touched.
  const auto examine = [&](double& right, double& error) {
    Beliefs beliefs(map);
    right = error = 0;
    for (size_t i = 0; i < touched.size(); ++i) {
      const Belief belief = beliefs.at(middle(i));
      right += most_probable_class(belief.class_probability) == truth[i];
      const std::vector<double>& all = test.at(touched[i].material);
      const double others = (statistics_of(all).mean * double(all.size()) - touched[i].value) / double(all.size() - 1);
      error += std::abs(*mean(belief.next_reading[0]) - others);
    }
    right /= double(touched.size());
    error /= double(touched.size());
  };
  double right_before, error_before, right_after, error_after;
  examine(right_before, error_before);
  for (size_t i = 0; i < touched.size(); ++i) touch(map, i, touched[i].value);
  examine(right_after, error_after);
  WARN("smdra_friction: " << touched.size() << " touches; class accuracy " << right_before << " -> " << right_after
                          << ", mean property error " << error_before << " -> " << error_after);
  CHECK(right_before < 0.8);
  CHECK(right_after > 0.95);
  CHECK(error_after < 0.2 * error_before);
}
