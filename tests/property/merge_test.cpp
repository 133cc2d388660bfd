#include "mapping/maps/merge.h"

#include <algorithm>
#include <catch2/catch.hpp>
#include <map>
#include <random>

#include "core/error.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/maps/map_diff.h"
#include "tests/support/labelled_map.h"
#include "tests/support/random_map.h"
#include "tests/support/views.h"

using namespace felt;
using Catch::Matchers::Contains;

namespace {

/// Frames first, first + step, ... < 12 of one fixed recording.
Map fused(int first, int step) {
  Map map(0.02, 0.08);
  IntegrationScratch scratch;
  test::Random random(11);
  for (int n = 0; n < 12; ++n) {
    const Frame frame = test::ball_before_wall(test::jittered_pose(random));
    if (n < first || (n - first) % step != 0) continue;
    integrate(map, frame, {}, scratch);
    record_frame(map.frames, "recording", "default", n);
  }
  return map;
}

/// Adds evidence that a joint run would have given: whole counts.
void add_labels(Map& map, uint64_t seed) {
  map.classes = ClassTable({{1, "wood", {}, false}, {2, "grass", {}, false}, {3, "ice", {}, false}});
  for (const uint32_t number : map.store.sorted()) {
    Block& block = map.store[number];
    for (uint16_t slot = 0; slot < 3; ++slot) {
      if ((seed + slot + uint64_t(block.coord.x & 7)) % 3 == 0) continue;
      Plane* plane = map.store.new_plane();
      for (int i = 0; i < kBlockVoxels; ++i)
        if (block.geometry->weight[i] > 0) plane->value[i] = float((seed * 7 + size_t(i)) % 5);
      block.evidence.push_back({slot, plane});
    }
  }
}

/// A map whose blocks all of `random_votes` have, each with even evidence and instances of its own, or without.
Map random_votes(uint64_t seed) {
  Map map = test::random_map({.seed = 4, .blocks = 8, .classes = 2, .shared_evidence = true, .instances = true});
  std::mt19937_64 engine(seed);
  for (const uint32_t number : map.store.sorted()) {
    Block& block = map.store[number];
    if (engine() % 3 == 0) block.even_evidence = nullptr;
    if (engine() % 3 == 0) block.instance = nullptr;
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (!(block.geometry->weight[i] > 0)) continue;
      if (block.even_evidence != nullptr) block.even_evidence->value[i] = float(engine() % 100) / 8;
      // Few ids, so that maps agree now and then; votes without a lead, too.
      if (block.instance != nullptr) {
        block.instance->id[i] = uint16_t(engine() % 4);
        block.instance->votes[i] = block.instance->id[i] == 0 ? uint16_t(0) : uint16_t(engine() % 6);
      }
    }
  }
  return map;
}

double max_difference(const MapDifference& d, const std::string& name) {
  for (const ChannelDifference& c : d.channels)
    if (c.name == name) return c.max_difference;
  return -1;
}

}  // namespace

TEST_CASE("merging parts of a recording equals fusing it whole") {
  const Map whole = fused(0, 1);
  const Map parts[] = {fused(0, 4), fused(1, 4), fused(2, 4), fused(3, 4)};
  const Map* const pointers[] = {&parts[0], &parts[1], &parts[2], &parts[3]};
  const Map merged = merge(pointers);
  const MapDifference d = difference(whole, merged);
  // The same voxels; counts exactly, averages within rounding: 12 steps of a 24-bit average of values up to 0.08 m,
  // weights up to 12 with fractions from the drop-off, and colour rounded to 1/256 grey level in each of 12 steps.
  CHECK_FALSE(beyond(d, 0.05));
  CHECK(max_difference(d, "tsdf") < 12 * 0.08 * 0x1p-23);
  CHECK(max_difference(d, "tsdf") > 0);
  CHECK(max_difference(d, "weight") < 12 * 12 * 0x1p-23);
  CHECK(max_difference(d, "color_count") == 0);
  CHECK(max_difference(d, "color") <= 12.0 / 256);
  CHECK(frame_count(merged.frames) == 12);
  CHECK(merged.frames == whole.frames);
}

TEST_CASE("merged evidence is the sum of the parts, plane by plane") {
  Map a = fused(0, 2), b = fused(1, 2);
  add_labels(a, 1);
  add_labels(b, 2);
  const Map* const pointers[] = {&a, &b};
  const Map merged = merge(pointers);
  size_t compared = 0;
  for (const Block& block : merged.store.blocks())
    for (const EvidencePlane& plane : block.evidence)
      for (int i = 0; i < kBlockVoxels; ++i) {
        float expected = 0;
        for (const Map* map : pointers)
          if (const Block* from = map->store.get(block.coord))
            for (const EvidencePlane& e : from->evidence)
              if (e.slot == plane.slot) expected += e.counts->value[i];
        compared += expected != 0;
        if (plane.counts->value[i] != expected) FAIL("voxel " << i << " of class " << plane.slot);
      }
  CHECK(compared > 1000);
}

TEST_CASE("even evidence is added, and of the parts' instances the one with most votes stays, with its lead") {
  const Map parts[] = {random_votes(1), random_votes(2), random_votes(3)};
  const Map* const pointers[] = {&parts[0], &parts[1], &parts[2]};
  const Map merged = merge(pointers, {.allow_shared_frames = true});
  size_t even = 0, agreed = 0, disputed = 0, tied = 0;
  for (const Block& block : merged.store.blocks())
    for (int i = 0; i < kBlockVoxels; ++i) {
      double even_sum = 0;
      std::map<int, int> votes;
      int all = 0;
      for (const Map& part : parts) {
        const Block& from = *part.store.get(block.coord);
        if (from.even_evidence != nullptr) even_sum += double(from.even_evidence->value[i]);
        if (from.instance == nullptr || from.instance->id[i] == 0) continue;
        votes[from.instance->id[i]] += from.instance->votes[i];
        all += from.instance->votes[i];
      }
      int id = 0, most = 0;
      for (const auto& [candidate, count] : votes)
        if (id == 0 || count > most) id = candidate, most = count;
      const int lead = std::max(0, most - (all - most));
      CAPTURE(i, id, most, all);
      REQUIRE((block.even_evidence == nullptr ? 0 : double(block.even_evidence->value[i])) == even_sum);
      REQUIRE((block.instance == nullptr ? 0 : int(block.instance->id[i])) == id);
      REQUIRE((block.instance == nullptr ? 0 : int(block.instance->votes[i])) == lead);
      even += even_sum > 0, agreed += votes.size() == 1, disputed += lead > 0 && lead < most;
      tied += lead == 0 && most > 0;
    }
  CHECK(even > 1000);
  CHECK(agreed > 500);
  CHECK(disputed > 100);
  CHECK(tied > 30);
}

TEST_CASE("the order of the maps does not change a bit of the merged map") {
  Map a = fused(0, 3), b = fused(1, 3), c = fused(2, 3);
  add_labels(a, 1);
  add_labels(b, 2);
  add_labels(c, 3);
  const Map* order[] = {&a, &b, &c};
  const Map first = merge(order);
  const std::string hash = map_hash(first);
  for (const auto& [x, y, z] : {std::tuple{0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}) {
    const Map* const all[] = {&a, &b, &c};
    const Map* const other[] = {all[x], all[y], all[z]};
    const Map merged = merge(other);
    CHECK(map_hash(merged) == hash);
    CHECK(merged.frames == first.frames);
    CHECK(merged.metadata == first.metadata);
  }
}

TEST_CASE("a map merged with nothing but itself or an empty map keeps its values") {
  const Map map = test::random_map({.seed = 5, .blocks = 10, .classes = 2});
  const Map empty(0.02, 0.08);
  const Map* const alone[] = {&map};
  const Map* const with_empty[] = {&empty, &map};
  // The random map's counts of colour go beyond what fusion counts to; they are cut.
  CHECK_FALSE(beyond(difference(merge(with_empty), merge(alone)), 0));
  MapDifference d = difference(map, merge(alone));
  for (const ChannelDifference& c : d.channels)
    if (c.name != "color_count") {
      INFO(c.name);
      CHECK(c.max_difference == 0);
      CHECK(c.voxels_only_a + c.voxels_only_b == 0);
    }
}

TEST_CASE("maps that share frames are refused unless that is allowed") {
  const Map a = fused(0, 2), b = fused(0, 3);
  const Map* const pointers[] = {&a, &b};
  CHECK_THROWS_WITH(merge(pointers), Contains("2 shared") && Contains("of map 1") && Contains("recording"));
  const Map twice = merge(pointers, {.allow_shared_frames = true});
  CHECK(frame_count(twice.frames) == 10);
}

TEST_CASE("frames of the same images with other poses are counted, those of other images or other numbers are not") {
  const std::string images = "0123456789abcdef", others = "fedcba9876543210";
  FrameJournal a, b;
  for (const int64_t i : {0, 1, 2, 3}) record_frame(a, images + others, "", i);
  for (const int64_t i : {2, 3, 4}) record_frame(b, images + images, "", i);
  record_frame(b, images + images, "other settings", 3);
  record_frame(b, others + others, "", 0);
  CHECK(frames_of_same_images(a, b) == 2);
  CHECK(frames_of_same_images(b, a) == 2);
  CHECK(frames_of_same_images(a, a) == 0);  // shared frames, which are refused
  CHECK(shared_frames(a, b).empty());
  FrameJournal later, other;
  record_frame(later, images + images, "", 9);
  record_frame(other, others + others, "", 0);
  CHECK(of_same_images_elsewhere(a, later));
  CHECK_FALSE(of_same_images_elsewhere(a, a));
  CHECK_FALSE(of_same_images_elsewhere(a, other));
}

TEST_CASE("a property table that continues another merges with it, and where two differ the property is named") {
  const auto property = [](const char* name) {
    Property p;
    p.name = name;
    return p;
  };
  Map a(0.02, 0.08), b(0.02, 0.08), c(0.02, 0.08);
  a.properties = PropertyTable({property("friction")});
  b.properties = PropertyTable({property("friction"), property("stiffness")});
  const Map *const pointers[] = {&c, &a, &b}, *const other[] = {&b, &c, &a};
  CHECK(merge(pointers).properties == b.properties);
  CHECK(merge(other).properties == b.properties);

  Property stiffness = property("stiffness");
  stiffness.unit = "N/m";
  c.properties = PropertyTable({property("friction"), stiffness});
  CHECK_THROWS_WITH(merge(pointers), Contains("property table") && Contains("'stiffness' has another unit"));
  c.properties = PropertyTable({property("stiffness")});
  CHECK_THROWS_WITH(merge(pointers), Contains("property 1 is 'friction' and 'stiffness'"));
}

TEST_CASE("every reason why maps cannot be merged is named at once") {
  Map a(0.02, 0.08), b(0.01, 0.04), c(0.02, 0.08);
  a.classes = ClassTable({{1, "wood", {}, false}});
  c.classes = ClassTable({{1, "grass", {}, false}});
  const Map* const pointers[] = {&a, &b, &c};
  CHECK_THROWS_WITH(merge(pointers), Contains("map 2: voxel size: expected 20 mm, found 10 mm") &&
                                         Contains("map 2: truncation") && Contains("map 3: class table"));
  CHECK_THROWS_AS(merge({}), ConfigError);
}

TEST_CASE("a merged weight does not pass the cap") {
  Map a(0.02, 0.08), b(0.02, 0.08);
  for (Map* map : {&a, &b}) {
    Block& block = map->store[map->store.find_or_create({0, 0, 0})];
    block.geometry->weight[0] = 200;
    block.geometry->tsdf[0] = map == &a ? 0.02f : 0.04f;
  }
  const Map* const pointers[] = {&a, &b};
  const Map merged = merge(pointers);
  CHECK(merged.store[0].geometry->weight[0] == 255);
  CHECK(merged.store[0].geometry->tsdf[0] == Approx(0.03));
}

TEST_CASE("evidence beyond the cap is brought down to it, all classes of a voxel alike") {
  Map a = fused(0, 2), b = fused(1, 2);
  add_labels(a, 1);
  add_labels(b, 2);
  const Map* const pointers[] = {&a, &b};
  const Map free = merge(pointers), capped = merge(pointers, {.max_evidence = 5});
  size_t cut = 0, kept = 0;
  for (const uint32_t n : free.store.sorted()) {
    const Block& from = free.store[n];
    const Block& to = *capped.store.get(from.coord);
    REQUIRE(from.evidence.size() == to.evidence.size());
    for (int i = 0; i < kBlockVoxels; ++i) {
      float before = 0, after = 0;
      for (const EvidencePlane& e : from.evidence) before += e.counts->value[i];
      for (const EvidencePlane& e : to.evidence) after += e.counts->value[i];
      REQUIRE(after == Approx(std::min(before, 5.0f)));
      for (size_t c = 0; c < from.evidence.size() && before > 0; ++c)
        REQUIRE(to.evidence[c].counts->value[i] == Approx(from.evidence[c].counts->value[i] * after / before));
      (before > 5 ? cut : kept) += before > 0;
    }
  }
  CHECK(cut > 1000);
  CHECK(kept > 1000);
}

TEST_CASE("even evidence counts for the cap and is brought down with that of the classes") {
  const Map a = random_votes(1), b = random_votes(2);
  const Map* const pointers[] = {&a, &b};
  const Map free = merge(pointers, {.allow_shared_frames = true}),
            capped = merge(pointers, {.allow_shared_frames = true, .max_evidence = 5});
  size_t cut = 0, only_by_even = 0;
  for (const Block& from : free.store.blocks()) {
    const Block& to = *capped.store.get(from.coord);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const double before = test::total_evidence(from, i), after = test::total_evidence(to, i);
      REQUIRE(after == Approx(std::min(before, 5.0)));
      if (from.even_evidence == nullptr || before == 0) continue;
      const double even = double(from.even_evidence->value[i]);
      REQUIRE(double(to.even_evidence->value[i]) == Approx(even * after / before));
      cut += before > 5, only_by_even += before > 5 && before - even < 5;
    }
  }
  CHECK(cut > 1000);
  CHECK(only_by_even > 100);
  // What has been at the cap before stays as it is.
  const Map* const alone[] = {&capped};
  CHECK(map_hash(merge(alone, {.max_evidence = 5})) == map_hash(capped));
}
