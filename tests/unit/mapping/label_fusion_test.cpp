#include "mapping/fusion/label_fusion.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <map>

#include "core/error.h"
#include "mapping/fusion/label_evidence.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/fusion/view_novelty.h"
#include "mapping/labels/class_belief.h"
#include "mapping/labels/ignored_classes.h"
#include "tests/support/views.h"

using namespace felt;

namespace {

/// Classes with ids 10, 20, ..., and an ignored one with id 0.
ClassTable table(int k) {
  std::vector<ClassInfo> classes = {{0, "nothing", {}, true}};
  for (int i = 0; i < k; ++i) classes.push_back({uint16_t(10 * (i + 1)), "class " + std::to_string(i), {}, false});
  return ClassTable(classes);
}

/// A block that one pixel sees whole, on the surface.
struct OneBlock {
  BlockStore store{0.08f};
  uint32_t number = store.find_or_create({0, 0, 0});
  ClassTable classes;
  BlockObservation observation{};
  LabelImage labels{1, 1};
  ProbabilityImage probabilities;
  LabelView view;

  explicit OneBlock(int k) : classes(table(k)) {
    std::fill_n(observation.valid, kBlockVoxels / 8, uint8_t(0xff));
    observation.groups = ~uint32_t(0);
    view.classes = &classes;
    view.band_m = 0.02f;
    view.evidence = 1;
  }
  LabelStats fuse() {
    LabelFusion fusion(view, store);
    fusion.add(observation, store[number]);
    return fusion.finish();
  }
  LabelStats see(uint16_t id) {
    labels(0, 0) = id;
    view.labels = &labels, view.probabilities = nullptr;
    return fuse();
  }
  LabelStats see(const std::vector<std::pair<uint16_t, float>>& named) {
    probabilities = {1, 1, int(named.size()), {}, {}};
    for (const auto& [id, p] : named) probabilities.class_id.push_back(id), probabilities.probability.push_back(p);
    view.labels = nullptr, view.probabilities = &probabilities;
    return fuse();
  }
  /// Evidence of each class at one voxel, the shared part included.
  std::vector<double> evidence(int offset = 100) const {
    std::vector<double> alpha(size_t(classes.size()));
    class_concentration(&store[number], offset, classes, alpha);
    for (double& a : alpha) a -= 1;
    return alpha;
  }
};

void check_near(const std::vector<double>& found, const std::vector<double>& expected) {
  REQUIRE(found.size() == expected.size());
  for (size_t i = 0; i < found.size(); ++i) CHECK(found[i] == Approx(expected[i]).margin(1e-6));
}

}  // namespace

TEST_CASE("mass that top-m probabilities drop goes evenly to the classes they do not name") {
  for (const int k : {2, 4, 7}) {
    OneBlock block(k);
    CHECK(block.see({{20, 0.7f}}).voxels == kBlockVoxels);
    std::vector<double> expected(size_t(k), 0.3 / (k - 1));
    expected[1] = 0.7;
    check_near(block.evidence(), expected);
  }
  OneBlock left_out(4);
  left_out.view.config.spread_dropped = false;
  left_out.see({{20, 0.7f}});
  check_near(left_out.evidence(), {0, 0.7, 0, 0});
}

TEST_CASE("dropped mass takes no more planes than there are classes named, and one") {
  OneBlock block(150);
  block.see({{20, 0.7f}, {300, 0.2f}});
  CHECK(block.store[block.number].evidence.size() == 2);
  CHECK(block.store[block.number].even_evidence != nullptr);
  OneBlock whole(150);  // 16-bit images round: nothing was dropped here
  whole.see({{20, 45874 / 65535.0f}, {300, 19660 / 65535.0f}});
  CHECK(whole.store[whole.number].even_evidence == nullptr);
}

TEST_CASE("a named class that is less probable than an unnamed one's share counts as unnamed") {
  OneBlock block(5);
  block.see({{10, 0.5f}, {20, 0.01f}});
  check_near(block.evidence(), {0.5, 0.125, 0.125, 0.125, 0.125});
}

TEST_CASE("probability of ignored classes says nothing, that of unknown ids is counted besides") {
  OneBlock block(3);
  CHECK(block.see({{10, 0.5f}, {0, 0.5f}}).unknown == 0);
  check_near(block.evidence(), {0.5, 0, 0});
  const LabelStats stats = block.see({{11, 0.5f}, {20, 0.5f}});
  CHECK(stats.unknown == kBlockVoxels);
  check_near(block.evidence(), {0.5, 0.5, 0});
  CHECK(block.see({{11, 1.0f}}).voxels == 0);
}

TEST_CASE("probabilities that are no distribution are counted and leave no trace") {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const float bad : {nan, inf, -inf, -0.1f, 1.5f}) {
    OneBlock block(3);
    const LabelStats stats = block.see({{10, 0.5f}, {20, bad}});
    CHECK(stats.invalid == kBlockVoxels);
    CHECK(stats.voxels == 0);
    check_near(block.evidence(), {0, 0, 0});
    for (const EvidencePlane& e : block.store[block.number].evidence)
      for (const float v : e.counts->value) REQUIRE(v == 0);
  }
}

TEST_CASE("a confusion matrix turns a label into evidence for the classes that are called so") {
  // Class 2 is mostly called class 1, so label 1 speaks for both.
  const std::vector<double> counts = {9, 1, 0, 0, 10, 0, 0, 8, 2};
  for (const int most : {1, 2, 3}) {
    OneBlock block(3);
    const LabelEvidence evidence = label_evidence(counts, 3, most);
    block.view.config.likelihood = &evidence;
    block.see(20);
    if (most == 1)
      check_near(block.evidence(), {4.5 / 19, 10 / 19.0, 4.5 / 19});
    else
      check_near(block.evidence(), {1 / 19.0, 10 / 19.0, 8 / 19.0});  // with two named the rest is one class
  }
  const LabelEvidence evidence = label_evidence(counts, 3, 3);
  OneBlock block(3);
  block.view.config.likelihood = &evidence;
  block.see({{20, 0.5f}, {10, 0.5f}});
  check_near(block.evidence(), {0.5 + 0.5 / 19, 5 / 19.0, 4 / 19.0});
}

TEST_CASE("a class that was never predicted is believed when it is") {
  const LabelEvidence evidence = label_evidence(std::vector<double>{4, 0, 1, 0}, 2);
  CHECK(evidence.shares[1] == std::vector<LabelEvidence::Share>{{1, 1.0f}});
  CHECK(evidence.even[1] == 0);
}

TEST_CASE("tempering and the cap hold for every kind of evidence") {
  for (const bool soft : {false, true}) {
    OneBlock block(3);
    block.view.evidence = 0.25f;
    block.view.config.max_evidence = 2;
    const auto see = [&](uint16_t id) { soft ? block.see({{id, 0.8f}}) : block.see(id); };
    see(10);
    double sum = 0;
    for (const double e : block.evidence()) sum += e;
    CHECK(sum == Approx(0.25));
    for (int i = 0; i < 100; ++i) see(10);
    sum = 0;
    for (const double e : block.evidence()) sum += e;
    CHECK(sum == Approx(2));
    CHECK(block.evidence()[0] == Approx(soft ? 1.6 : 2.0));
    int needed = 0;
    while (block.evidence()[1] <= block.evidence()[0] && needed < 100) see(20), ++needed;
    CHECK(needed == 6);  // 2 (7/8)^n < 1 from n = 6 on
  }
}

TEST_CASE("a near voxel behind a thin sheet takes no label from it") {
  // A board 3 cm before a wall, within the truncation: first away, then in the way and called something else.
  Map map(0.01, 0.06);
  map.classes = table(2);
  Frame frame;
  frame.camera = {100, 100, 39.5, 29.5, 80, 60};
  IntegrationScratch scratch;
  frame.depth_m = DepthImage(80, 60, 1.0f);
  frame.labels = LabelImage(80, 60, 10);
  integrate(map, frame, {}, scratch);
  const auto evidence_at = [&](const Index3& voxel, int slot) {
    std::vector<double> alpha(2);
    class_concentration(map.store.get(block_of_voxel(voxel)), offset_in_block(voxel), map.classes, alpha);
    return alpha[size_t(slot)] - 1;
  };
  REQUIRE(evidence_at({0, 0, 100}, 0) == 1);
  frame.depth_m = DepthImage(80, 60, 0.97f);
  frame.labels = LabelImage(80, 60, 20);
  integrate(map, frame, {}, scratch);
  CHECK(evidence_at({0, 0, 97}, 1) == 1);
  for (const int z : {99, 100, 101}) {
    CHECK(evidence_at({0, 0, z}, 1) == 0);
    CHECK(evidence_at({0, 0, z}, 0) <= 1);
  }
}

TEST_CASE("views add in proportion to how far they are from all earlier ones") {
  const auto view = [](double x, double degrees) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation().x() = x;
    T.linear() = Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitY()).matrix();
    return T;
  };
  ViewNovelty novelty;
  CHECK(novelty.add(view(0, 0), 0.1, 10) == 1);
  CHECK(novelty.add(view(0, 0), 0.1, 10) == 0);
  CHECK(novelty.add(view(0.02, 0), 0.1, 10) == Approx(0.2));
  CHECK(novelty.add(view(0.02, 5), 0.1, 10) == Approx(0.5));
  CHECK(novelty.add(view(0.5, 0), 0.1, 10) == 1);
  CHECK(novelty.add(view(0.01, 0), 0.1, 10) == Approx(0.1));  // back between two earlier ones
  // What a path adds does not depend on its frame rate.
  for (const int frames : {20, 200}) {
    ViewNovelty path;
    double sum = 0;
    for (int i = 0; i <= frames; ++i) sum += path.add(view(1.0 * i / frames, 0), 0.1, 0);
    CHECK(sum == Approx(11));
  }
  ViewNovelty off;
  for (int i = 0; i < 3; ++i) CHECK(off.add(view(0, 0), 0, 0) == 1);
}

TEST_CASE("a camera that stands still adds one observation, however long") {
  Map map(0.03, 0.12);
  map.classes = table(2);
  IntegrationConfig config;
  config.labels.novelty_m = 0.1f;
  IntegrationScratch scratch;
  Frame frame = test::ball_before_wall(Eigen::Isometry3d::Identity());
  frame.labels = LabelImage(frame.depth_m.width(), frame.depth_m.height(), 10);
  const LabelStats first = integrate(map, frame, config, scratch).labels;
  CHECK(first.voxels > 1000);
  for (int i = 0; i < 5; ++i) CHECK(integrate(map, frame, config, scratch).labels.voxels == 0);
}

TEST_CASE("instance ids are the majority of the votes") {
  OneBlock block(1);
  Image<uint16_t> instances(1, 1);
  block.view.classes = nullptr;
  block.view.instances = &instances;
  const auto see = [&](uint16_t id) {
    instances(0, 0) = id;
    block.fuse();
  };
  see(0);
  see(kNoLabel);
  CHECK(block.store[block.number].instance == nullptr);
  test::Random random(3);
  std::map<uint16_t, int> votes;
  for (int i = 0; i < 200; ++i) {
    const auto id = uint16_t(random() < 0.55 ? 7 : 1 + random() * 6);
    ++votes[id];
    see(id);
  }
  REQUIRE(votes[7] > 100);
  for (const int voxel : {0, 77, 511}) CHECK(block.store[block.number].instance->id[voxel] == 7);
  for (int i = 0; i < 1000; ++i) see(9);
  CHECK(block.store[block.number].instance->votes[0] == 255);
  for (int i = 0; i < 256; ++i) see(5);
  CHECK(block.store[block.number].instance->id[0] == 5);  // what changed is learned again
}

TEST_CASE("images of a frame that have not its depth's size are refused, not read") {
  Map map(0.03, 0.12);
  map.classes = table(2);
  IntegrationScratch scratch;
  const Frame good = test::ball_before_wall(Eigen::Isometry3d::Identity());
  Frame frame = good;
  frame.index = 12;
  frame.labels = LabelImage(80, 60, 10);
  CHECK_THROWS_WITH(integrate(map, frame, {}, scratch),
                    "frame 12: label image: expected 160 x 120 as its depth, found 80 x 60");
  frame = good;
  frame.instances = Image<uint16_t>(160, 121);
  CHECK_THROWS_AS(integrate(map, frame, {}, scratch), FormatError);
  frame = good;
  frame.probabilities = {160, 120, 2, std::vector<uint16_t>(160 * 120 * 2), std::vector<float>(160 * 120)};
  CHECK_THROWS_AS(integrate(map, frame, {}, scratch), FormatError);
}

TEST_CASE("ignored classes leave neither labels nor surface") {
  Frame frame = test::ball_before_wall(Eigen::Isometry3d::Identity());
  const ClassTable classes({{1, "wall", {}, false}, {2, "person", {}, false}, {3, "dog", {}, false}});
  frame.labels = LabelImage(frame.depth_m.width(), frame.depth_m.height(), 1);
  size_t ball = 0;
  for (size_t i = 0; i < frame.depth_m.size(); ++i)
    if (frame.depth_m.data()[i] < 1.9f) frame.labels.data()[i] = 2, ++ball;
  REQUIRE(ball > 100);
  const IgnoredClasses ignored = ignored_classes(classes, {"person", "dog"}, "--ignore-classes");
  CHECK(ignored.ids == std::vector<uint16_t>{2, 3});
  CHECK(ignored.table.size() == 1);
  for (const bool soft : {false, true}) {
    Frame view = frame;
    if (soft) {
      view.probabilities = {frame.depth_m.width(), frame.depth_m.height(), 2, {}, {}};
      for (const uint16_t id : frame.labels) {
        view.probabilities.class_id.insert(view.probabilities.class_id.end(), {uint16_t(3 - id), id});
        view.probabilities.probability.insert(view.probabilities.probability.end(), {0.4f, 0.6f});
      }
      view.labels = {};
    }
    CHECK(clear_depth_of(ignored.ids, view) == ball);
    Map map(0.03, 0.12);
    map.classes = ignored.table;
    IntegrationScratch scratch;
    integrate(map, view, {}, scratch);
    for (const Block& block : map.store.blocks()) CHECK(first_voxel(block.coord).z * 0.03 > 1.5);
  }
  CHECK_THROWS_WITH(ignored_classes(classes, {"cat"}, "--ignore-classes"),
                    "--ignore-classes: class: expected one of wall, person, dog, found 'cat'");
}
