#include "io/simulation/scene_library.h"

#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "io/simulation/furniture.h"
#include "io/simulation/rooms.h"

namespace felt {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

Scene empty_scene(const std::string& description, const Vector3d& low_m, const Vector3d& high_m) {
  Scene scene;
  scene.description = description;
  scene.bounds = {low_m, high_m};
  scene.semantics = simulated_semantics();
  scene.materials = simulated_materials();
  return scene;
}

/// Way-points on three quarters of a circle around a point, looking at it.
std::vector<WayPoint> around(const Vector3d& center_m, double radius_m, double height_m) {
  std::vector<WayPoint> path;
  for (int i = 0; i <= 9; ++i) {
    const double angle = i * kPi / 6 - kPi * 0.75;
    path.push_back({center_m + Vector3d(radius_m * std::cos(angle), radius_m * std::sin(angle), height_m), center_m});
  }
  return path;
}

/// A vertical plane at y = 1 m that faces -y, the middle of its patch at `middle_m` above the floor.
Isometry3d wall_at_y1(double middle_m) {
  Isometry3d wall = Isometry3d::Identity();
  wall.linear() << Vector3d(1, 0, 0), Vector3d(0, 0, 1), Vector3d(0, -1, 0);
  wall.translation() = Vector3d(0, 1, middle_m);
  return wall;
}

const Finish kTable = {kWood, {Pattern::wood, {206, 164, 112, 255}, {150, 106, 62, 255}, 0.14}};
const Finish kGround = {kConcrete, {Pattern::checker, {186, 182, 174, 255}, {120, 124, 130, 255}, 0.25}};
const Finish kWallPaint = {kPaint, {Pattern::noise, {226, 214, 190, 255}, {190, 172, 140, 255}, 0.3}};

Scene plane_scene() {
  Scene scene = empty_scene("one wall, seen at changing angles", {-2, 0, 0}, {2, 1, 3});
  SceneBuilder b(scene);
  b.begin("wall", kWall, wall_at_y1(1.5));
  b.plane(4, 3, {kPaint, {Pattern::checker, {222, 206, 178, 255}, {106, 132, 150, 255}, 0.2}});
  scene.light_m = {0.5, -1, 2.4};
  scene.path = {{{-1.0, -0.8, 1.5}, {0, 1, 1.5}}, {{0, -0.7, 1.3}, {0, 1, 1.5}}, {{1.0, -0.9, 1.6}, {0, 1, 1.4}}};
  return scene;
}

Scene sphere_scene() {
  Scene scene = empty_scene("a sphere of half a metre, seen from all round", {-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6});
  SceneBuilder b(scene);
  b.begin("sphere", kOtherProp, Isometry3d::Identity());
  b.sphere({0, 0, 0}, 0.5, {kRubber, {Pattern::checker, {206, 70, 60, 255}, {240, 232, 216, 255}, 0.16}});
  scene.light_m = {1.2, -1.0, 1.8};
  scene.path = around({0, 0, 0}, 1.4, 0.5);
  return scene;
}

Scene boxes_scene() {
  Scene scene = empty_scene("boxes, a ball and a column on a floor", {-1.5, -1.5, 0}, {1.5, 1.5, 1.2});
  SceneBuilder b(scene);
  b.begin("floor", kFloor, Isometry3d::Identity());
  b.plane(3, 3, kGround);
  b.begin("large box", kBox, floor_pose(-0.35, 0.2, 0.3));
  b.box({0, 0, 0.25}, {0.6, 0.4, 0.5}, kTable);
  b.begin("small box", kBox, floor_pose(-0.3, 0.2, 0.9, 0.5));
  b.box({0, 0, 0.125}, {0.25, 0.25, 0.25}, {kPlastic, {Pattern::plain, {84, 128, 196, 255}, {50, 80, 140, 255}, 0.2}});
  b.begin("flat box", kBox, floor_pose(0.55, -0.45, -0.4));
  b.box({0, 0, 0.08}, {0.5, 0.7, 0.16}, {kPaper, {Pattern::stripes, {214, 190, 150, 255}, {170, 140, 96, 255}, 0.08}});
  b.begin("ball", kOtherProp, floor_pose(0.45, 0.5, 0));
  b.sphere({0, 0, 0.22}, 0.22, {kRubber, {Pattern::checker, {206, 70, 60, 255}, {240, 232, 216, 255}, 0.14}});
  b.begin("column", kOtherFurniture, floor_pose(-0.7, -0.75, 0));
  b.cylinder({0, 0, 0.45}, 0.12, 0.9, {kRock, {Pattern::noise, {170, 162, 150, 255}, {110, 104, 98, 255}, 0.08}});
  scene.light_m = {0.8, -1.0, 2.2};
  scene.path = around({0, 0, 0.25}, 1.9, 0.95);
  return scene;
}

/// The crossing of Ewen et al. 2024: a way over concrete, ice that looks like snow, and concrete again.
Scene ice_crossing_scene() {
  Scene scene = empty_scene("a way across ice between concrete and snow", {-2, -3, 0}, {2, 3, 1.2});
  SceneBuilder b(scene);
  const auto ground = [&](const char* name, double y0, double y1, double x0, double x1, const Finish& finish) {
    b.begin(name, kFloor, floor_pose((x0 + x1) / 2, (y0 + y1) / 2, 0));
    b.box({0, 0, -0.25}, {x1 - x0, y1 - y0, 0.5}, finish);
  };
  const Finish concrete = {kConcrete, {Pattern::tiles, {168, 166, 160, 255}, {118, 116, 112, 255}, 0.6}};
  const Finish ice = {kIce, {Pattern::noise, {206, 226, 238, 255}, {160, 198, 222, 255}, 0.35}};
  const Finish snow = {kSnow, {Pattern::noise, {246, 248, 252, 255}, {216, 224, 236, 255}, 0.12}};
  ground("concrete", -3, -1, -1, 1, concrete);
  ground("ice", -1, 1, -1, 1, ice);
  ground("concrete", 1, 3, -1, 1, concrete);
  ground("snow", -3, 3, -2, -1, snow);
  ground("snow", -3, 3, 1, 2, snow);
  b.begin("rock", kOtherProp, floor_pose(-1.5, 0.4, 0));
  b.sphere({0, 0, 0.05}, 0.32, {kRock, {Pattern::noise, {128, 120, 112, 255}, {82, 78, 74, 255}, 0.1}});
  b.begin("bollard", kOtherProp, floor_pose(1.3, -0.9, 0));
  b.cylinder({0, 0, 0.45}, 0.09, 0.9, {kRubber, {Pattern::stripes, {214, 120, 40, 255}, {240, 232, 220, 255}, 0.15}});
  scene.light_m = {0.5, -0.5, 3.0};
  scene.path = {{{0, -3.3, 1.4}, {0, -0.6, 0}},
                {{-0.3, -2.2, 1.5}, {0.1, 0.2, 0}},
                {{0.3, -1.2, 1.5}, {-0.1, 1.2, 0}},
                {{0.1, 0.3, 1.5}, {0, 2.4, 0}}};
  return scene;
}

Scene table_wall_scene() {
  Scene scene =
      empty_scene("a table pushed against a wall: creases between four segments", {-1.3, -1, 0}, {1.3, 1, 1.6});
  SceneBuilder b(scene);
  b.begin("floor", kFloor, Isometry3d::Identity());
  b.plane(2.6, 2, {kConcrete, {Pattern::tiles, {176, 170, 160, 255}, {120, 116, 110, 255}, 0.4}});
  b.begin("wall", kWall, wall_at_y1(0.8));
  b.plane(2.6, 1.6, kWallPaint);
  add_table(b, floor_pose(0, 0.65, 0), 1.4, 0.7, kTable);
  add_crate(b, floor_pose(0.35, 0.7, 0.2, 0.74), 0.3,
            {kPlastic, {Pattern::plain, {84, 128, 196, 255}, {50, 80, 140, 255}, 0.2}});
  scene.light_m = {-0.3, -0.8, 2.2};
  scene.path = {{{-1.0, -1.1, 1.5}, {0, 0.6, 0.6}},
                {{0, -1.3, 1.3}, {0, 0.7, 0.6}},
                {{1.0, -1.0, 1.5}, {0, 0.7, 0.6}},
                {{0.4, -0.9, 0.5}, {0, 0.7, 0.5}}};
  return scene;
}

Scene door_scene() {
  Scene scene = empty_scene("a door in a wall", {-1.5, -0.5, 0}, {1.5, 1, 2.5});
  SceneBuilder b(scene);
  b.begin("floor", kFloor, Isometry3d::Identity());
  b.plane(3, 2, {kConcrete, {Pattern::tiles, {176, 170, 160, 255}, {120, 116, 110, 255}, 0.4}});
  b.begin("wall", kWall, wall_at_y1(1.25));
  b.plane(3, 2.5, kWallPaint);
  add_door(b, floor_pose(0, 1, -kPi / 2), kTable);
  scene.light_m = {0.2, -0.8, 2.3};
  scene.path = {{{-0.9, -1.4, 1.5}, {0, 1, 1.1}}, {{0, -1.6, 1.4}, {0, 1, 1.1}}, {{0.9, -1.3, 1.5}, {0, 1, 1.1}}};
  return scene;
}

const std::vector<std::pair<std::string, std::function<Scene()>>>& library() {
  static const std::vector<std::pair<std::string, std::function<Scene()>>> scenes = {
      {"plane", plane_scene},
      {"sphere", sphere_scene},
      {"boxes", boxes_scene},
      {"table_wall", table_wall_scene},
      {"door", door_scene},
      {"ice_crossing", ice_crossing_scene},
      {"room1", [] { return furnished_room(1); }},
      {"room2", [] { return furnished_room(2); }},
      {"room3", [] { return furnished_room(3); }},
      {"room4", [] { return furnished_room(4); }},
      {"room5", [] { return furnished_room(5); }}};
  return scenes;
}

}  // namespace

const std::vector<std::string>& scene_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const auto& [name, make] : library()) all.push_back(name);
    return all;
  }();
  return names;
}

Scene make_scene(const std::string& name) {
  for (const auto& [candidate, make] : library()) {
    if (candidate != name) continue;
    Scene scene = make();
    scene.name = name;
    return scene;
  }
  throw ConfigError(describe_mismatch("simulate", "scene", "one of " + listed(scene_names()), "'" + name + "'"));
}

}  // namespace felt
