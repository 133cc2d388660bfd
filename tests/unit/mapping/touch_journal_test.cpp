#include "mapping/store/touch_journal.h"

#include <catch2/catch.hpp>
#include <string>

#include "mapping/maps/merge.h"
#include "mapping/touch/touch_update.h"
#include "tests/support/material_floors.h"

using namespace felt;
using namespace felt::test;

TEST_CASE("undo gives back the map as it was, redo the map as it became") {
  Map map = two_floors(snow, wood, 7);
  const std::string untouched = map_hash(map);
  const uint64_t first = touch(map, reading(-0.2, 0, 0.3));
  const std::string once = map_hash(map);
  const uint64_t second = touch(map, reading(-0.2, 0.1, 0.5, 1));
  const std::string twice = map_hash(map);
  CHECK(untouched != once);
  CHECK(once != twice);
  undo_touch(map, first);
  CHECK(map_hash(map) != twice);
  redo_touch(map, first);
  CHECK(map_hash(map) == twice);
  undo_touch(map, second);
  CHECK(map_hash(map) == once);
  undo_touch(map, first);
  CHECK(map_hash(map) == untouched);
  CHECK(Beliefs(map).at({-10, 0, 0}).readings[0] == 0);
  CHECK_THROWS_WITH(undo_touch(map, first), Catch::Contains("undone already"));
  CHECK_THROWS_WITH(undo_touch(map, 1), Catch::Contains("no such id"));
}

TEST_CASE("touches by two masks at one point are two, in whatever order they come") {
  const Map map = two_floors(snow, wood, 4);
  ViewMask whole;
  whole.camera = {50, 50, 25, 25, 51, 51};
  whole.mask = Image<uint8_t>(51, 51, 1);
  whole.T_world_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  whole.T_world_camera.translation() = Eigen::Vector3d(-0.2, 0, 1);
  ViewMask half = whole, brighter = whole, moved = whole;
  for (int y = 26; y < 51; ++y)
    for (int x = 0; x < 51; ++x) half.mask(x, y) = 0;
  brighter.mask = Image<uint8_t>(51, 51, 255);  // the same pixels
  moved.T_world_camera.translation().x() = -0.21;
  CHECK(digest(whole) == digest(brighter));
  CHECK(digest(whole) != digest(half));
  CHECK(digest(whole) != digest(moved));
  TouchRequest request = reading(-0.2, 0, 0.3);
  request.region.rule = RegionRule::mask;
  const Touch of_whole = resolve_touch(map, request, &whole), of_half = resolve_touch(map, request, &half);
  TouchJournal one, other;
  insert(one, of_whole), insert(one, of_half);
  insert(other, of_half), insert(other, of_whole);
  CHECK(journal_digest(one) == journal_digest(other));
  TouchJournal first, second;
  insert(first, of_whole), insert(second, of_half);
  CHECK(journal_digest(joined(first, second)) == journal_digest(one));
  // Without a mask nothing of it counts.
  CHECK(resolve_touch(map, reading(-0.2, 0, 0.3), &whole).request.view == 0);
}

TEST_CASE("joining two journals gives every touch once, whichever comes first") {
  Map map = two_floors(snow, wood, 4);
  TouchJournal left, right;
  const Touch shared = resolve_touch(map, reading(-0.2, 0, 0.3, 2));
  insert(left, resolve_touch(map, reading(-0.2, 0, 0.2, 3)));
  insert(left, shared);
  insert(right, resolve_touch(map, reading(0.2, 0, 0.4, 1)));
  insert(right, shared);
  const TouchJournal both = joined(left, right);
  REQUIRE(both.touches.size() == 3);
  CHECK(both.touches[0].request.stamp_s == 1);
  CHECK(both.touches[2].request.stamp_s == 3);
  CHECK(journal_digest(both) == journal_digest(joined(right, left)));
  // What either noted of the shared touch at the time may differ: one of the two is kept, always the same.
  const uint64_t id = both.touches[1].id;
  left.find(id)->after.mean = 0.3, right.find(id)->after.mean = 0.2;
  const double kept = joined(left, right).find(id)->after.mean;
  CHECK((kept == 0.3 || kept == 0.2));
  CHECK(joined(right, left).find(id)->after.mean == kept);
}

TEST_CASE("a touch that two journals share is undone where both say so, and has the regions of both") {
  Map map = two_floors(snow, wood, 4);
  const Touch touch = resolve_touch(map, reading(-0.2, 0, 0.3)), elsewhere = resolve_touch(map, reading(0.2, 0, 0.3));
  REQUIRE_FALSE(touch.region == elsewhere.region);
  for (const bool undone_left : {false, true})
    for (const bool undone_right : {false, true}) {
      INFO("undone left " << undone_left << ", right " << undone_right);
      TouchJournal left, right;
      const uint64_t id = insert(left, touch);
      REQUIRE(insert(right, touch) == id);
      left.find(id)->undone = undone_left;
      right.find(id)->undone = undone_right;
      right.find(id)->region = elsewhere.region;
      for (const TouchJournal& both : {joined(left, right), joined(right, left)}) {
        REQUIRE(both.touches.size() == 1);
        CHECK(both.touches[0].undone == (undone_left && undone_right));
        CHECK((both.touches[0].region == united(touch.region, elsewhere.region)));
      }
    }
}

TEST_CASE("a merged map holds the touches of both maps") {
  Map left = two_floors(snow, wood, 4), right = two_floors(snow, wood, 4);
  touch(left, reading(-0.2, 0, 0.15, 1));
  touch(right, reading(-0.2, 0, 0.17, 2));
  const Map* maps[] = {&left, &right};
  const Map merged = merge(maps);
  const Belief belief = Beliefs(merged).at({-10, 0, 0});
  CHECK(belief.readings[0] == 2);
  CHECK(most_probable_class(belief.class_probability) == ice);
  const Block& block = *merged.store.get(block_of_voxel({-10, 0, 0}));
  REQUIRE(block.touch.size() == 1);
  CHECK(block.touch[0].n->value[offset_in_block({-10, 0, 0})] == 2);
}
