#include "mapping/touch/touch_suggestion.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "inference/information_gain.h"
#include "mapping/touch/touch_update.h"
#include "tests/support/material_floors.h"

using namespace felt;
using namespace felt::test;

TEST_CASE("a suggestion says what a touch there would teach") {
  Map map = two_floors(snow, wood, 7);
  const std::vector<Suggestion> suggestions = suggest_touches(map, "friction", {});
  REQUIRE(suggestions.size() == 2);
  for (const Suggestion& s : suggestions) {
    INFO("at x = " << s.point_m.x());
    CHECK(std::abs(s.point_m.z()) < 1e-6);
    CHECK(s.normal.z() == Approx(1));
    const auto there = [&](double value) { return resolve_touch(map, reading(s.point_m.x(), s.point_m.y(), value)); };
    const Region region = there(0.3).region;
    CHECK(double(s.voxels) == Approx(double(region.voxels())).epsilon(1e-3));
    // 20 columns of voxels to the left of x = 0, 21 from there on, 41 rows.
    CHECK(s.area_m2 == Approx((s.point_m.x() < 0 ? 20 : 21) * 41 * kFloorVoxel_m * kFloorVoxel_m).epsilon(0.03));
    const Belief belief = Beliefs(map).of(region, {});
    CHECK(s.gain_nat == Approx(information_gain(belief.next_reading[0]).value).epsilon(1e-9));
    REQUIRE_FALSE(s.outcomes.empty());
    CHECK(s.outcomes[0].slot == (s.point_m.x() < 0 ? snow : wood));
    for (const Outcome& outcome : s.outcomes) {
      CHECK(outcome.probability == Approx(belief.class_probability[size_t(outcome.slot)]).epsilon(1e-9));
      const TouchEffect effect = apply_touch(map, there(outcome.reading));
      undo_touch(map, effect.id);
      for (size_t c = 0; c < 8; ++c)
        CHECK(outcome.class_probability[c] == Approx(effect.after.class_probability[c]).epsilon(1e-9));
    }
  }
  CHECK(suggestions[0].gain_nat * suggestions[0].area_m2 >= suggestions[1].gain_nat * suggestions[1].area_m2);
}

TEST_CASE("a segment holds the voxel that it was grown from") {
  const Map map = two_floors(snow, wood, 7);
  const RegionSettings settings;
  const std::vector<Region> found = segments(map, settings, 200);
  REQUIRE(found.size() == 2);
  // None came before the first: it is all that a touch of one of its voxels would update.
  Index3 voxel;
  for_each_bit(found[0].mask[0], [&](int i) { voxel = voxel_at(found[0].coord[0], i); });
  const Contact contact = find_contact(map, Eigen::Vector3d(voxel.x, voxel.y, voxel.z) * kFloorVoxel_m, settings);
  CHECK(found[0] == find_region(map, contact, settings));
}
