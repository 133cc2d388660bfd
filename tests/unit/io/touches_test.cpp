#include "io/readings/touches.h"

#include <catch2/catch.hpp>
#include <fstream>
#include <optional>
#include <string>

#include "io/map_file/map_file.h"
#include "io/readings/mask_image.h"
#include "io/readings/points.h"
#include "io/readings/touch_json.h"
#include "io/tables/property_yaml.h"
#include "tests/support/data.h"
#include "tests/support/labelled_map.h"

using namespace felt;
using namespace felt::test;

namespace {

Map floor_map() {
  Map map = labelled_map(
      0.02, {-0.4, -0.4, -0.1}, {0.4, 0.4, 0.1}, [](const Eigen::Vector3d& p) { return p.z(); },
      class_table({"wood", "snow", "ice"}), [](const Eigen::Vector3d& p) { return p.x() < 0 ? 1 : 0; });
  map.properties = read_properties(felt::test::source_dir().string() + "/data/properties.yaml");
  return map;
}

}  // namespace

TEST_CASE("recorded touches are read by column name") {
  const auto touches = parse_touches(
      "# comment\nvalue,property,frame,u,v,sigma\n0.3,friction,7,12,13.5,\n\n0.4,friction,8,1,2,0.05\n", "t.csv");
  REQUIRE(touches.size() == 2);
  CHECK(touches[0].line == 3);
  CHECK(touches[0].frame == 7);
  CHECK_FALSE(touches[0].stamp_s);
  CHECK(touches[0].pixel->y() == 13.5);
  CHECK(touches[0].sigma == 0);
  CHECK(touches[1].sigma == 0.05);
}

TEST_CASE("rows of one touch file may give a point or a pixel each") {
  const auto touches =
      parse_touches("frame,x,y,z,u,v,property,value\n7,1,2,3,,,friction,0.3\n8,,,,12,13,friction,0.4\n", "t.csv");
  REQUIRE(touches.size() == 2);
  CHECK(*touches[0].point_m == Eigen::Vector3d(1, 2, 3));
  CHECK_FALSE(touches[0].pixel);
  CHECK_FALSE(touches[1].point_m);
  CHECK(*touches[1].pixel == Eigen::Vector2d(12, 13));
  CHECK_THROWS_WITH(parse_touches("frame,x,y,z,u,v,property,value\n7,1,,3,,,friction,0.3\n", "t.csv"),
                    "t.csv:2: y: expected a number, found ''");
}

TEST_CASE("touch files of spreadsheets are read: a byte order mark, semicolons, Windows line ends") {
  const auto touches = parse_touches("\xef\xbb\xbfstamp;x;y;z;property;value\r\n1;2;3;4;\"friction\";0.3\r\n", "t.csv");
  REQUIRE(touches.size() == 1);
  CHECK(touches[0].line == 2);
  CHECK(touches[0].stamp_s == 1);
  CHECK(*touches[0].point_m == Eigen::Vector3d(2, 3, 4));
  CHECK(touches[0].property == "friction");
  CHECK_THROWS_WITH(parse_touches("stamp;x;y;z;property;value\n1;2;3;4;friction;0,3\n", "t.csv"),
                    "t.csv:2: value: expected a number, found '0,3'");
}

TEST_CASE("points are read with or without a header, by commas or semicolons, after a byte order mark") {
  const TemporaryDirectory folder;
  const auto file = folder.path() / "points.csv";
  const auto read = [&](const std::string& text) {
    std::ofstream(file, std::ios::binary) << text;
    return read_points(file);
  };
  const std::vector<Eigen::Vector3d> expected = {{1, -2, 0.5}, {3, 4, 5}};
  CHECK(read("1,-2,0.5\n3 , 4 , 5\n") == expected);
  CHECK(read("\xef\xbb\xbfx,y,z\r\n1,-2,0.5\r\n\r\n# end\r\n3,4,5") == expected);
  CHECK(read("\xef\xbb\xbf"
             "1;-2;0.5\n3;4;5\n") == expected);
  CHECK_THROWS_WITH(read("1,2\n1,2,3,4\nx,y,z\n"),
                    file.string() + ":1: point: expected x,y,z, found '1,2' (and 2 more faults)");
  CHECK(read("id,z,x,y,note\n7,0.5,1,-2,door\n8,5,3,4,\n") == expected);
  CHECK_THROWS_WITH(read("id,x,y,z\n7,1,-2\n8,3,4,5\n"),
                    file.string() + ":2: point: expected 4 cells, numbers in x, y and z, found '7,1,-2'");
  CHECK_THROWS_WITH(read("x,y,z,x\n1,2,3,4\n"), Catch::Contains("expected x,y,z, found 'x,y,z,x'"));
  CHECK_THROWS_WITH(read_points(folder.path()), Catch::Contains("found a folder"));
}

TEST_CASE("a mask that cannot be read is told from one that is no image") {
  const TemporaryDirectory folder;
  const auto file = folder.path() / "mask.png";
  const std::vector<double> camera = {20, 20, 11.5, 7.5}, pose = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  CHECK_THROWS_WITH(read_view_mask(file, camera, pose), Catch::Contains("found nothing"));
  CHECK_THROWS_WITH(read_view_mask(folder.path(), camera, pose), Catch::Contains("found a folder"));
  std::ofstream(file) << "no image";
  CHECK_THROWS_AS(read_view_mask(file, camera, pose), FormatError);
}

TEST_CASE("the first fault of a touch file is named with its line, and how many more there are") {
  CHECK_THROWS_WITH(parse_touches("stamp,x,y,z,property,value\n1,2,3,zz,friction,0.3\n1,2\n", "t.csv"),
                    "t.csv:2: z: expected a number, found 'zz' (and 1 more fault)");
  CHECK_THROWS_WITH(parse_touches("x,y,z\n", "t.csv"), Catch::Contains("stamp or frame") && Catch::Contains("value"));
  CHECK_THROWS_WITH(parse_touches("", "t.csv"), Catch::Contains("empty file"));
  CHECK_THROWS_AS(read_touches("/does/not/exist.csv"), IoError);
}

TEST_CASE("columns of one's own do not count, a misspelt sigma is no such") {
  CHECK(parse_touches("id,frame,x,y,z,property,value,note\n1,7,1,2,3,friction,0.3,wet\n", "t.csv").size() == 1);
  for (const char* slip : {"sgima", "Sigma", "sigma_"})
    CHECK_THROWS_WITH(parse_touches(std::string("frame,x,y,z,property,value,") + slip + "\n", "t.csv"),
                      "t.csv:1: header: expected 'sigma', found '" + std::string(slip) + "'");
  CHECK(parse_touches("frame,x,y,z,property,value,sigma,sigma2\n7,1,2,3,friction,0.3,0.1,\n", "t.csv")[0].sigma == 0.1);
}

TEST_CASE("a pixel touch lands where its frame saw the surface, one outside the sequence is refused") {
  Map map = floor_map();
  Frame frame;
  frame.index = 3;
  frame.stamp_s = 30;
  frame.camera = {100, 100, 50, 50, 101, 101};
  frame.depth_m = DepthImage(101, 101, 1.0f);
  frame.T_world_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  frame.T_world_camera.translation() = Eigen::Vector3d(0, 0, 1);
  const TouchedSequence sequence{{{0, 0}, {1, 10}, {2, 20}, {3, 30}, {4, 40}},
                                 [&](size_t place) { return place == 3 ? std::optional(frame) : std::nullopt; }};
  const auto outcomes = apply_recorded_touches(
      map,
      parse_touches("stamp,u,v,property,value\n30,30,50,friction,0.2\n50,30,50,friction,0.2\n30,500,50,friction,0.2\n",
                    "t"),
      {}, &sequence);
  REQUIRE(outcomes.size() == 3);
  REQUIRE(outcomes[0].effect);
  const Touch& touch = *map.touches.find(outcomes[0].effect->id);
  CHECK((touch.surface_m - Eigen::Vector3d(-0.2, 0, 0)).norm() < 0.011);
  CHECK_THAT(outcomes[1].refused, Catch::Contains("stamp"));
  CHECK_THAT(outcomes[2].refused, Catch::Contains("pixel"));
  CHECK(map.touches.touches.size() == 1);
}

TEST_CASE("readings that count already are left out if told so, one row for each") {
  Map map = floor_map();
  const auto touches = parse_touches(
      "stamp,x,y,z,property,value\n1,-0.2,0,0,friction,0.2\n1,-0.2,0,0,friction,0.2\n2,-0.2,0,0,friction,0.2\n", "t");
  TouchRequest request;
  request.stamp_s = 1;
  request.point_m = {-0.2, 0, 0};
  request.property = "friction";
  request.value = 0.2;
  request.model = TouchModel::mixture;  // the same reading, understood in another way
  const uint64_t id = apply_touch(map, resolve_touch(map, request)).id;
  const auto left_out = [&] {
    std::vector<bool> known;
    for (const TouchOutcome& outcome : apply_recorded_touches(map, touches, {}, nullptr, KnownReadings::leave_out)) {
      CHECK(outcome.refused.empty());
      CHECK(outcome.already_counted != outcome.effect.has_value());
      known.push_back(outcome.already_counted);
    }
    return known;
  };
  undo_touch(map, id);
  CHECK(left_out() == std::vector<bool>{false, false, false});
  CHECK(left_out() == std::vector<bool>{true, true, true});
  CHECK(map.touches.touches.size() == 4);
  Map once = floor_map();
  std::swap(map, once);
  apply_touch(map, resolve_touch(map, request));
  CHECK(left_out() == std::vector<bool>{true, false, false});
  CHECK(apply_recorded_touches(map, touches, {}, nullptr).front().effect.has_value());
}

TEST_CASE("a touched map goes through its file unchanged, touches, regions and undone ones included") {
  const TemporaryDirectory folder;
  Map map = floor_map();
  TouchRequest request;
  request.property = "friction";
  request.point_m = {-0.2, 0, 0};
  request.value = 0.2;
  request.rho = 0.25;
  const uint64_t first = apply_touch(map, resolve_touch(map, request)).id;
  request.model = TouchModel::mixture;
  request.value = 0.3;
  request.sigma = 0.01;
  apply_touch(map, resolve_touch(map, request));
  undo_touch(map, first);
  save_map(map, folder.path() / "map.vdb");
  Map loaded = load_map(folder.path() / "map.vdb");
  CHECK(map_hash(loaded) == map_hash(map));
  CHECK(loaded.properties == map.properties);
  REQUIRE(loaded.touches.touches.size() == 2);
  for (size_t t = 0; t < 2; ++t) {
    CHECK(loaded.touches.touches[t].region == map.touches.touches[t].region);
    CHECK(loaded.touches.touches[t].undone == map.touches.touches[t].undone);
    CHECK(loaded.touches.touches[t].after.mean == map.touches.touches[t].after.mean);
    CHECK(touch_journal_json(loaded.touches) == touch_journal_json(map.touches));
  }
  redo_touch(loaded, first);
  redo_touch(map, first);
  CHECK(map_hash(loaded) == map_hash(map));
  CHECK_THROWS_AS(parse_touch_journal("[{\"id\": 3}]", "m"), FormatError);
}
