#include "io/simulation/rooms.h"

#include <numbers>

#include "io/simulation/furniture.h"

namespace felt {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
// Walls by the direction in which they lie from the room's centre.
enum Wall : int { kEast, kNorth, kWest, kSouth };

Finish finish(uint16_t material, Pattern pattern, Rgba8 first, Rgba8 second, double scale_m) {
  return {material, {pattern, first, second, scale_m}};
}

const Finish kOak = finish(kWood, Pattern::wood, {206, 164, 112, 255}, {150, 106, 62, 255}, 0.14);
const Finish kWalnut = finish(kWood, Pattern::wood, {128, 86, 58, 255}, {78, 50, 34, 255}, 0.12);
const Finish kPine = finish(kWood, Pattern::wood, {232, 202, 152, 255}, {196, 154, 98, 255}, 0.16);
const Finish kWhiteWood = finish(kWood, Pattern::plain, {244, 240, 232, 255}, {206, 200, 190, 255}, 0.3);
const Finish kSteel = finish(kMetal, Pattern::plain, {150, 154, 160, 255}, {104, 108, 116, 255}, 0.3);

Finish fabric(Rgba8 first, Rgba8 second) { return finish(kFabric, Pattern::noise, first, second, 0.04); }
Finish plastic(Rgba8 first) {
  return finish(kPlastic, Pattern::plain, first,
                {uint8_t(first.r / 4 * 3), uint8_t(first.g / 4 * 3), uint8_t(first.b / 4 * 3), 255}, 0.3);
}
Finish rubber(Rgba8 first, Rgba8 second, double scale_m) {
  return finish(kRubber, Pattern::checker, first, second, scale_m);
}

/// A room under construction: its size, and poses on its walls.
struct Room {
  Scene scene;
  SceneBuilder builder{scene};
  Vector3d size_m;

  Room(const std::string& name, const std::string& description, const Vector3d& size, const Finish& floor,
       const Finish& walls, const Finish& skirting)
      : size_m(size) {
    scene.name = name;
    scene.description = description;
    scene.semantics = simulated_semantics();
    scene.materials = simulated_materials();
    add_room_shell(builder, scene, size, floor, walls, skirting);
  }
  Room(const Room&) = delete;

  /// Facing into the room from a wall: `along_m` from the wall's middle to the left as one looks into the room,
  /// `off_m` from the wall, on the floor or at a height.
  Isometry3d at_wall(Wall wall, double along_m, double off_m, double height_m = 0) const {
    const double yaw = int(wall) * kPi / 2 + kPi, away_m = wall % 2 == 0 ? size_m.x() / 2 : size_m.y() / 2;
    const Isometry3d T = floor_pose(0, 0, yaw, height_m);
    const Vector3d p = T * Vector3d(off_m - away_m, along_m, 0);
    return floor_pose(p.x(), p.y(), yaw, height_m);
  }
};

/// 1: living room with a dining corner, oak floor.
void furnish_living_room(Room& r) {
  SceneBuilder& b = r.builder;
  add_rug(b, floor_pose(-1.15, -0.75, 0), 1.6, 2.3,
          finish(kFabric, Pattern::stripes, {176, 58, 52, 255}, {238, 210, 170, 255}, 0.09));
  add_sofa(b, r.at_wall(kWest, 0.75, 0.50), 2.0, fabric({62, 92, 118, 255}, {90, 124, 150, 255}),
           fabric({224, 168, 62, 255}, {240, 196, 104, 255}));
  add_table(b, floor_pose(-1.05, -0.75, kPi / 2, 0.016), 0.95, 0.55, kWalnut);
  add_cabinet(b, r.at_wall(kSouth, 0.9, 0.25), 1.5, 0.48, kWhiteWood);
  add_television(b, r.at_wall(kSouth, 0.9, 0.22, 0.48), 1.05);
  add_table(b, floor_pose(1.25, 0.85, 0), 1.4, 0.8, kOak);
  add_chair(b, floor_pose(0.95, 0.25, kPi / 2), plastic({226, 92, 70, 255}), kPine);
  add_chair(b, floor_pose(1.6, 0.25, kPi / 2 + 0.2), plastic({70, 140, 150, 255}), kPine);
  add_chair(b, floor_pose(0.25, 0.9, -0.1), plastic({240, 196, 78, 255}), kPine);
  add_bookshelf(b, r.at_wall(kNorth, 1.1, 0.16), 1.1, 1.95, kOak, 11);
  add_floor_lamp(b, floor_pose(-2.2, -1.75, 0));
  add_plant(b, floor_pose(2.1, 1.65, 0), 1.35);
  add_ball(b, floor_pose(0.1, -1.2, 0), 0.14, rubber({210, 60, 60, 255}, {240, 240, 240, 255}, 0.11));
  add_crate(b, floor_pose(2.0, -1.55, 0.3), 0.42, plastic({84, 128, 196, 255}));
  add_door(b, r.at_wall(kEast, 0.55, 0), kPine);
  add_window(b, r.at_wall(kNorth, -0.9, 0), 1.5, 1.15);
  add_picture(b, r.at_wall(kWest, 0.75, 0), 1.0, 0.6, {246, 196, 140, 255}, {96, 62, 92, 255});
  add_picture(b, r.at_wall(kEast, -0.95, 0), 0.6, 0.7, {190, 214, 224, 255}, {62, 104, 96, 255});
  r.scene.path = {{{0.3, -0.2, 1.45}, {-2.3, -0.6, 0.5}}, {{0.0, 0.3, 1.5}, {-1.6, 1.9, 0.8}},
                  {{-0.4, 0.2, 1.5}, {1.3, 1.6, 0.6}},    {{-0.6, 0.1, 1.45}, {2.2, 0.2, 0.6}},
                  {{-0.3, 0.6, 1.4}, {1.2, -1.8, 0.4}},   {{0.4, -0.6, 1.5}, {-1.5, -1.4, 0.3}}};
}

/// 2: bedroom, pine floor.
void furnish_bedroom(Room& r) {
  SceneBuilder& b = r.builder;
  add_rug(b, floor_pose(0.75, -0.15, 0), 1.7, 1.2,
          finish(kFabric, Pattern::noise, {226, 218, 204, 255}, {150, 136, 124, 255}, 0.06));
  add_bed(b, r.at_wall(kWest, 0.2, 1.12), 1.6, kWalnut, fabric({72, 116, 108, 255}, {108, 152, 140, 255}));
  add_cabinet(b, r.at_wall(kWest, -1.05, 0.25), 0.5, 0.5, kWalnut);
  add_cabinet(b, r.at_wall(kWest, 1.42, 0.25), 0.5, 0.5, kWalnut);
  add_bookshelf(b, r.at_wall(kNorth, -1.3, 0.16), 0.8, 1.6, kWhiteWood, 23);
  add_table(b, r.at_wall(kSouth, 0.95, 0.32), 0.6, 1.2, kPine);
  add_chair(b, floor_pose(1.0, -0.95, -kPi / 2 + 0.15), kPine, kPine);
  add_television(b, r.at_wall(kSouth, 0.95, 0.25, 0.74), 0.6);
  add_floor_lamp(b, floor_pose(1.9, -1.6, 0));
  add_pouf(b, floor_pose(1.75, 1.0, 0), fabric({206, 124, 96, 255}, {224, 156, 128, 255}));
  add_crate(b, floor_pose(-0.35, 1.45, 0.1), 0.40, kPine);
  add_plant(b, floor_pose(1.95, 0.1, 0), 1.1);
  add_door(b, r.at_wall(kEast, -1.0, 0), kWhiteWood);
  add_window(b, r.at_wall(kNorth, 0.35, 0), 1.3, 1.1);
  add_picture(b, r.at_wall(kWest, 0.2, 0), 1.1, 0.55, {204, 220, 236, 255}, {64, 84, 120, 255});
  add_picture(b, r.at_wall(kEast, 0.5, 0), 0.5, 0.65, {240, 214, 190, 255}, {176, 88, 72, 255});
  r.scene.path = {{{0.9, 0.4, 1.55}, {-1.6, -0.4, 0.5}}, {{1.0, 0.5, 1.55}, {-1.2, 1.5, 0.5}},
                  {{0.8, 0.3, 1.5}, {1.2, 1.7, 0.8}},    {{0.3, 0.0, 1.5}, {2.1, 0.3, 0.8}},
                  {{0.1, 0.2, 1.5}, {1.2, -1.6, 0.6}},   {{0.9, 0.6, 1.5}, {-1.4, -1.5, 0.4}}};
}

/// 3: workshop loft, concrete floor and walls.
void furnish_workshop(Room& r) {
  SceneBuilder& b = r.builder;
  const Finish mat = rubber({44, 46, 50, 255}, {70, 72, 78, 255}, 0.10);
  add_rug(b, floor_pose(-0.9, 1.05, 0), 2.0, 0.9, mat);
  add_table(b, r.at_wall(kNorth, 0.9, 0.42), 0.75, 2.0, kPine);
  add_crate(b, r.at_wall(kNorth, 1.5, 0.36, 0.74), 0.28, plastic({214, 168, 44, 255}));
  add_crate(b, r.at_wall(kNorth, 0.5, 0.36, 0.74), 0.22, kSteel);
  add_bookshelf(b, r.at_wall(kEast, 0.9, 0.16), 1.2, 1.6, kSteel, 37);
  add_cabinet(b, r.at_wall(kEast, -0.8, 0.25), 1.3, 0.9, plastic({52, 92, 132, 255}));
  add_table(b, floor_pose(0.35, -0.55, 0.25), 1.5, 0.8, kOak);
  add_chair(b, floor_pose(0.3, -1.3, kPi / 2 + 0.3), plastic({60, 64, 72, 255}), kSteel);
  add_chair(b, floor_pose(-0.75, -0.9, 0.35), plastic({206, 70, 52, 255}), kSteel);
  add_crate(b, floor_pose(-2.3, -1.65, 0.15), 0.6, kPine);
  add_crate(b, floor_pose(-2.3, -1.65, 0.5, 0.48), 0.4, plastic({80, 150, 96, 255}));
  add_crate(b, floor_pose(-1.6, -1.75, -0.2), 0.45, plastic({206, 206, 210, 255}));
  add_hearth(b, r.at_wall(kWest, -0.35, 0.31));
  add_ball(b, floor_pose(-1.9, -0.75, 0), 0.20, rubber({36, 38, 40, 255}, {80, 84, 88, 255}, 0.2));
  add_grass_planter(b, r.at_wall(kSouth, 1.3, 0.25), 1.3);
  add_door(b, r.at_wall(kSouth, -0.2, 0), kSteel);
  add_window(b, r.at_wall(kNorth, -1.1, 0), 1.6, 1.2);
  add_picture(b, r.at_wall(kWest, 1.2, 0), 0.5, 0.7, {232, 226, 210, 255}, {52, 60, 70, 255});
  r.scene.path = {{{-0.9, 0.3, 1.55}, {-2.4, -1.6, 0.4}}, {{-0.6, 0.4, 1.55}, {-2.7, 0.6, 0.7}},
                  {{-0.3, 0.5, 1.5}, {-0.9, 2.1, 0.8}},   {{0.2, 0.7, 1.5}, {2.4, 1.0, 0.8}},
                  {{0.2, 0.7, 1.5}, {1.6, -1.2, 0.5}},    {{-0.5, 0.6, 1.5}, {0.2, -1.4, 0.5}}};
}

/// 4: kitchen and dining room, tiled floor.
void furnish_kitchen(Room& r) {
  SceneBuilder& b = r.builder;
  add_cabinet(b, r.at_wall(kNorth, 0.2, 0.26), 2.6, 0.9,
              finish(kWood, Pattern::plain, {104, 138, 122, 255}, {84, 116, 102, 255}, 0.3));
  b.begin("worktop", kTable, r.at_wall(kNorth, 0.2, 0.29, 0.9));
  b.box({0, 0, 0.02}, {0.58, 2.66, 0.04},
        finish(kRock, Pattern::noise, {66, 66, 70, 255}, {150, 148, 146, 255}, 0.025));
  add_crate(b, r.at_wall(kNorth, 1.0, 0.3, 0.94), 0.26, kOak);
  add_crate(b, r.at_wall(kNorth, -0.6, 0.3, 0.94), 0.24, kSteel);
  add_cabinet(b, r.at_wall(kNorth, -1.75, 0.26), 0.8, 1.95, kSteel);
  add_round_table(b, floor_pose(-0.55, -0.6, 0), 0.60, 0.74, kWhiteWood);
  add_chair(b, floor_pose(-1.35, -0.55, 0.05), plastic({236, 232, 224, 255}), kOak);
  add_chair(b, floor_pose(-0.6, -1.4, kPi / 2), plastic({236, 232, 224, 255}), kOak);
  add_chair(b, floor_pose(0.25, -0.75, kPi - 0.2), plastic({96, 140, 176, 255}), kOak);
  add_bookshelf(b, r.at_wall(kEast, -0.55, 0.16), 0.9, 1.2, kPine, 41);
  add_rug(b, floor_pose(0.35, 0.82, 0), 1.5, 0.55, rubber({58, 74, 68, 255}, {84, 104, 96, 255}, 0.07));
  add_plant(b, floor_pose(-2.0, -1.35, 0), 1.5);
  add_grass_planter(b, r.at_wall(kSouth, -1.25, 0.24), 0.9);
  add_pouf(b, floor_pose(1.55, -1.25, 0), finish(kRubber, Pattern::plain, {120, 58, 56, 255}, {92, 42, 42, 255}, 0.3));
  add_door(b, r.at_wall(kWest, -0.55, 0), kOak);
  add_window(b, r.at_wall(kSouth, 0.45, 0), 1.4, 1.1);
  add_picture(b, r.at_wall(kEast, 0.6, 0), 0.7, 0.5, {250, 224, 160, 255}, {190, 90, 60, 255});
  r.scene.path = {{{1.0, 0.1, 1.5}, {-0.6, 1.7, 0.9}},  {{0.9, 0.0, 1.5}, {-1.9, 0.3, 0.8}},
                  {{0.8, 0.1, 1.5}, {-0.9, -1.6, 0.4}}, {{0.3, 0.15, 1.5}, {1.5, -1.4, 0.5}},
                  {{-0.5, 0.3, 1.5}, {2.0, 0.4, 0.7}},  {{-0.7, 0.4, 1.5}, {0.8, 1.8, 0.9}}};
}

/// 5: study, dark wood, two arm-chairs and a hearth.
void furnish_study(Room& r) {
  SceneBuilder& b = r.builder;
  const Finish leather = finish(kRubber, Pattern::noise, {112, 66, 44, 255}, {140, 90, 62, 255}, 0.08);
  add_rug(b, floor_pose(-0.5, 0.2, 0), 2.2, 1.8,
          finish(kFabric, Pattern::checker, {116, 40, 48, 255}, {196, 160, 116, 255}, 0.22));
  add_bookshelf(b, r.at_wall(kNorth, 1.1, 0.16), 1.3, 2.2, kWalnut, 53);
  add_bookshelf(b, r.at_wall(kNorth, -0.35, 0.16), 1.3, 2.2, kWalnut, 59);
  add_sofa(b, floor_pose(-1.35, 0.75, -0.4), 1.0, leather, fabric({210, 190, 150, 255}, {232, 216, 184, 255}));
  add_sofa(b, floor_pose(-1.3, -0.85, 0.45), 1.0, leather, fabric({150, 60, 60, 255}, {180, 90, 86, 255}));
  add_round_table(b, floor_pose(-0.35, -0.05, 0, 0.016), 0.34, 0.50, kWalnut);
  add_hearth(b, r.at_wall(kEast, 0.35, 0.31));
  add_table(b, r.at_wall(kSouth, -0.75, 0.45), 0.8, 1.5, kWalnut);
  add_chair(b, floor_pose(0.85, -1.0, -kPi / 2), fabric({60, 78, 66, 255}, {84, 104, 90, 255}), kWalnut);
  add_floor_lamp(b, floor_pose(-2.15, 1.55, 0));
  add_crate(b, floor_pose(1.85, -1.6, 0.2), 0.36, plastic({64, 66, 74, 255}));
  add_ball(b, r.at_wall(kSouth, -1.2, 0.45, 0.74), 0.13,
           finish(kPlastic, Pattern::noise, {52, 98, 150, 255}, {110, 150, 84, 255}, 0.09));
  add_door(b, r.at_wall(kWest, 0.0, 0), kWalnut);
  add_window(b, r.at_wall(kSouth, 1.0, 0), 1.1, 1.2);
  add_picture(b, r.at_wall(kEast, 0.35, 0, 0.15), 0.8, 0.5, {236, 206, 150, 255}, {92, 56, 40, 255});
  add_picture(b, r.at_wall(kSouth, -0.5, 0), 0.5, 0.6, {200, 210, 214, 255}, {76, 88, 70, 255});
  r.scene.path = {{{0.7, 0.1, 1.55}, {-1.7, 1.2, 0.6}}, {{0.8, 0.0, 1.55}, {-1.8, -0.9, 0.6}},
                  {{0.7, 0.5, 1.5}, {-0.9, -1.8, 0.6}}, {{0.3, 0.7, 1.5}, {1.5, -1.6, 0.5}},
                  {{0.0, 0.6, 1.5}, {2.2, 0.6, 0.7}},   {{0.1, 0.0, 1.55}, {0.4, 1.9, 1.0}}};
}

}  // namespace

Scene furnished_room(int number) {
  const auto painted = [](Rgba8 c, Rgba8 d) { return finish(kPaint, Pattern::noise, c, d, 0.5); };
  const std::string name = "room" + std::to_string(number);
  switch (number) {
    case 1: {
      Room r(name, "living room with a dining corner", {5.2, 4.2, 2.6}, kOak,
             painted({226, 214, 190, 255}, {214, 198, 168, 255}), kWhiteWood);
      furnish_living_room(r);
      return r.scene;
    }
    case 2: {
      Room r(name, "bedroom with a desk", {4.8, 3.9, 2.5}, kPine, painted({188, 204, 214, 255}, {170, 190, 204, 255}),
             kWhiteWood);
      furnish_bedroom(r);
      return r.scene;
    }
    case 3: {
      const Finish concrete = finish(kConcrete, Pattern::noise, {176, 174, 170, 255}, {138, 136, 134, 255}, 0.4);
      Room r(name, "workshop of concrete", {5.8, 4.6, 2.8},
             finish(kConcrete, Pattern::tiles, {162, 160, 156, 255}, {116, 114, 112, 255}, 1.2), concrete, kSteel);
      furnish_workshop(r);
      return r.scene;
    }
    case 4: {
      Room r(name, "kitchen with a round table", {5.0, 4.0, 2.5},
             finish(kRock, Pattern::tiles, {214, 206, 194, 255}, {150, 140, 130, 255}, 0.4),
             painted({232, 226, 206, 255}, {220, 210, 182, 255}), kWhiteWood);
      furnish_kitchen(r);
      return r.scene;
    }
    default: {
      Room r(name, "study with a hearth", {5.2, 4.2, 2.7}, kWalnut, painted({120, 142, 128, 255}, {104, 126, 112, 255}),
             kWalnut);
      furnish_study(r);
      return r.scene;
    }
  }
}

}  // namespace felt
