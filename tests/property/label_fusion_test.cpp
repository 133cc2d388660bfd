#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include <tbb/global_control.h>

#include "mapping/fusion/label_evidence.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/labels/class_belief.h"
#include "tests/support/simd_targets.h"
#include "tests/support/views.h"

using namespace felt;
using felt::test::ball_before_wall;
using felt::test::jittered_pose;
using felt::test::Random;

namespace {

ClassTable table(int k) {
  std::vector<ClassInfo> classes = {{0, "nothing", {}, true}};
  // A prior of 1, so that a count is found exactly when the prior is taken off.
  for (int i = 1; i <= k; ++i) classes.push_back({uint16_t(3 * i), "class " + std::to_string(i), {}, false, 1});
  return ClassTable(classes);
}

Frame labelled_frame(Random& random, int k) {
  Frame frame = ball_before_wall(jittered_pose(random));
  frame.labels = LabelImage(frame.depth_m.width(), frame.depth_m.height());
  for (uint16_t& id : frame.labels) id = uint16_t(random() * 3 * (k + 2));  // known, ignored and unknown ids
  return frame;
}

double evidence(const Map& map, const Index3& voxel, uint16_t slot) {
  const Block* block = map.store.get(block_of_voxel(voxel));
  if (block == nullptr) return 0;
  std::vector<double> alpha(size_t(map.classes.size()));
  class_concentration(block, offset_in_block(voxel), map.classes, alpha);
  return alpha[slot] - map.classes.prior(slot);
}

/// Visits every voxel that a view observes within the band, with its pixel.
template <typename Visit>
void visit_band(const Map& map, const Frame& frame, const IntegrationConfig& config, Visit visit) {
  const DepthView view = depth_view(frame, config, map, nullptr);
  AllocationScratch scratch;
  for (const BlockCoord& coord : blocks_in_view(frame.depth_m, frame.camera, frame.T_world_camera, map.voxel_size_m,
                                                map.truncation_m, config.min_depth_m, config.max_depth_m, scratch)) {
    BlockObservation seen;
    if (!observe_block_scalar(coord, view, seen)) continue;
    for (int i = 0; i < kBlockVoxels; ++i) {
      if ((seen.valid[i >> 3] >> (i & 7) & 1) == 0) continue;
      if (!(std::abs(seen.sdf_m[i]) < float(config.labels.band_vox * map.voxel_size_m))) continue;
      const Index3 first = first_voxel(coord), in = voxel_of_offset(i);
      visit(Index3{first.x + in.x, first.y + in.y, first.z + in.z}, seen.pixel[i]);
    }
  }
}

}  // namespace

TEST_CASE("class counts are exact: they equal a dictionary's, unknown and ignored ids are left out") {
  for (const int k : {2, 40, 150, 1000}) {
    Map map(0.03, 0.12);
    map.classes = table(k);
    IntegrationScratch scratch;
    const IntegrationConfig config;
    Random random{uint64_t(k)};
    std::map<std::pair<Index3, uint16_t>, double> dictionary;
    uint64_t unknown = 0, fused = 0, expected_unknown = 0;
    for (int n = 0; n < 4; ++n) {
      const Frame frame = labelled_frame(random, k);
      const FrameStats stats = integrate(map, frame, config, scratch);
      unknown += stats.labels.unknown, fused += stats.labels.voxels;
      visit_band(map, frame, config, [&](const Index3& voxel, int pixel) {
        const uint16_t id = frame.labels.data()[pixel];
        const bool is_class = id % 3 == 0 && id > 0 && id <= 3 * k;
        if (is_class) dictionary[{voxel, uint16_t(id / 3 - 1)}] += 1;
        expected_unknown += !is_class && id != 0;
      });
    }
    REQUIRE(dictionary.size() > 1000);
    CHECK(unknown == expected_unknown);
    double stored = 0, counted = 0;
    for (const auto& [key, count] : dictionary) {
      REQUIRE(evidence(map, key.first, key.second) == count);
      counted += count;
    }
    for (const Block& block : map.store.blocks())
      for (const EvidencePlane& e : block.evidence)
        for (const float v : e.counts->value) stored += v;
    CHECK(stored == counted);
    CHECK(double(fused) == counted);
  }
}

TEST_CASE("a pixel's probabilities add one unit of evidence however many classes were kept") {
  for (const bool spread : {true, false}) {
    Map map(0.03, 0.12);
    map.classes = table(5);
    IntegrationConfig config;
    config.labels.spread_dropped = spread;
    Random random(4);
    Frame frame = ball_before_wall(jittered_pose(random));
    ProbabilityImage& p = frame.probabilities;
    p.width = frame.depth_m.width(), p.height = frame.depth_m.height(), p.top = 2;
    for (size_t i = 0; i < frame.depth_m.size(); ++i) {
      p.class_id.insert(p.class_id.end(), {6, 12});
      p.probability.insert(p.probability.end(), {0.5f, 0.25f});
    }
    IntegrationScratch scratch;
    const FrameStats stats = integrate(map, frame, config, scratch);
    REQUIRE(stats.labels.voxels > 500);
    visit_band(map, frame, config, [&](const Index3& voxel, int) {
      REQUIRE(evidence(map, voxel, 1) == Approx(0.5));
      REQUIRE(evidence(map, voxel, 3) == Approx(0.25));
      double total = 0;
      for (uint16_t slot = 0; slot < 5; ++slot) total += evidence(map, voxel, slot);
      REQUIRE(total == Approx(spread ? 1.0 : 0.75));
      REQUIRE(evidence(map, voxel, 0) == Approx(spread ? 0.25 / 3 : 0.0));
    });
  }
}

TEST_CASE("classes cost what was seen of them and not what the table holds") {
  Random random(12);
  Frame hard = labelled_frame(random, 6), soft = ball_before_wall(jittered_pose(random));
  ProbabilityImage& p = soft.probabilities;
  p.width = soft.depth_m.width(), p.height = soft.depth_m.height(), p.top = 2;
  for (size_t i = 0; i < soft.depth_m.size(); ++i) {
    p.class_id.insert(p.class_id.end(), {6, 12});
    p.probability.insert(p.probability.end(), {0.5f, 0.25f});
  }
  for (const Frame* frame : {&hard, &soft}) {
    std::vector<size_t> bytes;
    for (const int k : {8, 150}) {
      Map map(0.03, 0.12);
      map.classes = table(k);
      IntegrationScratch scratch;
      REQUIRE(integrate(map, *frame, {}, scratch).labels.voxels > 500);
      bytes.push_back(class_bytes(map));
      CHECK(bytes.back() >= map.store.plane_bytes() / 2);
    }
    CHECK(bytes[0] == bytes[1]);
  }
}

TEST_CASE("capped evidence forgets the past and keeps its total") {
  Map map(0.03, 0.12);
  map.classes = table(2);
  IntegrationConfig config;
  config.labels.max_evidence = 5;
  IntegrationScratch scratch;
  Frame frame = ball_before_wall(Eigen::Isometry3d::Identity());
  frame.labels = LabelImage(frame.depth_m.width(), frame.depth_m.height(), 3);
  for (int n = 0; n < 50; ++n) integrate(map, frame, config, scratch);
  std::fill(frame.labels.begin(), frame.labels.end(), uint16_t(6));
  int needed = 0;
  const Index3 voxel{0, 0, 37};  // on the ball's front, at 1.11 m
  REQUIRE(evidence(map, voxel, 0) == Approx(5));
  while (evidence(map, voxel, 1) < evidence(map, voxel, 0) && needed < 100) {
    integrate(map, frame, config, scratch);
    ++needed;
    CHECK(evidence(map, voxel, 0) + evidence(map, voxel, 1) == Approx(5));
  }
  CHECK(needed <= 4);  // 5 (4/5)^n <= 2.5 from n = 4 on
}

TEST_CASE("a voxel behind another surface takes no label from it") {
  Map map(0.02, 0.08);
  map.classes = table(2);
  IntegrationScratch scratch;
  Frame frame = ball_before_wall(Eigen::Isometry3d::Identity());
  frame.labels = LabelImage(frame.depth_m.width(), frame.depth_m.height(), 3);  // the wall and the ball's front
  integrate(map, frame, {}, scratch);
  for (const Block& block : map.store.blocks())
    for (const EvidencePlane& e : block.evidence)
      for (int i = 0; i < kBlockVoxels; ++i) {
        if (e.counts->value[i] == 0) continue;
        const Index3 first = first_voxel(block.coord), in = voxel_of_offset(i);
        const Eigen::Vector3d p = Eigen::Vector3d(first.x + in.x, first.y + in.y, first.z + in.z) * 0.02;
        const double to_ball = std::abs((p - Eigen::Vector3d(0, 0, 1.4)).norm() - 0.3), to_wall = std::abs(p.z() - 2.0);
        REQUIRE(std::min(to_ball, to_wall) < 0.06);
        REQUIRE((p.z() < 1.4 || to_wall < 0.021));  // not inside the ball's back half
      }
}

namespace {

/// Top-3 probabilities of known, ignored and unknown classes, some with mass left over and some with repeated zeros.
ProbabilityImage random_probabilities(Random& random, int width, int height, int k) {
  ProbabilityImage image{width, height, 3, {}, {}};
  for (int pixel = 0; pixel < width * height; ++pixel) {
    float left = 1;
    uint16_t first = 0;
    for (int m = 0; m < 3; ++m) {
      const auto id = uint16_t(3 * int(random() * (k + 1)) + (random() < 0.05));
      const float p = id == first ? 0 : left * float(random() < 0.1 ? 1 : random());
      first = m == 0 ? id : first;
      left -= p;
      image.class_id.push_back(id);
      image.probability.push_back(p);
    }
  }
  return image;
}

/// Every kind of evidence at once, one after the other: labels, probabilities, a confusion matrix, a cap, instances.
std::string hash_of_everything() {
  constexpr int k = 12;
  Map map(0.03, 0.12);
  map.classes = table(k);
  IntegrationScratch scratch;
  Random random(77);
  std::vector<double> counts(k * k);
  for (double& c : counts) c = random() < 0.7 ? 0 : std::floor(100 * random());
  const LabelEvidence likelihood = label_evidence(counts, k, 3);
  for (int n = 0; n < 8; ++n) {
    Frame frame = labelled_frame(random, k);
    frame.instances = Image<uint16_t>(frame.depth_m.width(), frame.depth_m.height());
    for (uint16_t& id : frame.instances) id = uint16_t(4 * random());
    IntegrationConfig config;
    config.labels.instances = true;
    config.labels.evidence = 0.7f;
    config.labels.novelty_m = 0.5f;
    config.labels.max_evidence = n % 3 == 0 ? 0 : 1.5f;
    config.labels.likelihood = n % 4 >= 2 ? &likelihood : nullptr;
    if (n % 2 == 1)
      frame.probabilities = random_probabilities(random, frame.depth_m.width(), frame.depth_m.height(), k);
    integrate(map, frame, config, scratch);
  }
  return map_hash(map);
}

}  // namespace

TEST_CASE("every SIMD target and number of threads stores the same evidence, bit for bit") {
  choose_simd("scalar", "test");
  const std::string expected = hash_of_everything();
  choose_simd("", "test");
  test::on_every_simd_target([&](const std::string& target) {
    INFO(target);
    for (const size_t threads : {1, 2, 3, 8}) {
      const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
      CHECK(hash_of_everything() == expected);
    }
  });
}

TEST_CASE("probabilities are exact: their evidence equals a dictionary's, and no mass is lost or made") {
  for (const int k : {2, 3, 40, 1000}) {
    Map map(0.03, 0.12);
    map.classes = table(k);
    IntegrationScratch scratch;
    Random random{uint64_t(k) + 5};
    std::map<Index3, std::vector<double>> dictionary;
    double mass = 0;
    for (int n = 0; n < 3; ++n) {
      Frame frame = ball_before_wall(jittered_pose(random));
      frame.probabilities = random_probabilities(random, frame.depth_m.width(), frame.depth_m.height(), k);
      integrate(map, frame, {}, scratch);
      visit_band(map, frame, {}, [&](const Index3& voxel, int pixel) {
        // In plain words: named classes get their probability, the others evenly what is missing from one.
        std::map<int, double> named;
        double sum = 0;
        for (int m = 0; m < 3; ++m) {
          const uint16_t id = frame.probabilities.class_id[size_t(3 * pixel + m)];
          const double p = frame.probabilities.probability[size_t(3 * pixel + m)];
          sum += p;
          if (p > 0 && id % 3 == 0 && id > 0) named[id / 3 - 1] += p;
        }
        if (named.empty()) return;
        double rest = sum < 1 - 3 / 65535.0 ? 1 - sum : 0;
        while (int(named.size()) < k) {  // the least is one of the others where it is below their share
          const auto least = std::min_element(named.begin(), named.end(),
                                              [](const auto& a, const auto& b) { return a.second < b.second; });
          if (least == named.end() || least->second >= rest / (k - int(named.size()))) break;
          rest += least->second;
          named.erase(least);
        }
        std::vector<double>& alpha = dictionary[voxel];
        alpha.resize(size_t(k), 0.0);
        for (int slot = 0; slot < k; ++slot) {
          const auto at = named.find(slot);
          const bool all_named = int(named.size()) == k;
          const double share = rest / (all_named ? k : k - int(named.size()));
          const double add = at == named.end() ? share : at->second + (all_named ? share : 0);
          alpha[size_t(slot)] += add;
          mass += add;
        }
      });
    }
    REQUIRE(dictionary.size() > 1000);
    double stored = 0;
    for (const Block& block : map.store.blocks())
      for (int i = 0; i < kBlockVoxels; ++i) stored += double(total_evidence(block, i));
    CHECK(stored == Approx(mass).epsilon(1e-4));
    std::vector<double> found(static_cast<size_t>(k));
    int checked = 0;
    for (const auto& [voxel, expected] : dictionary) {
      if (++checked % (k > 100 ? 50 : 3) != 0) continue;
      class_concentration(map.store.get(block_of_voxel(voxel)), offset_in_block(voxel), map.classes, found);
      for (int slot = 0; slot < k; ++slot)
        REQUIRE(found[size_t(slot)] - 1 == Approx(expected[size_t(slot)]).margin(2e-6));
    }
  }
}
