#include "io/simulation/furniture.h"

#include <cmath>
#include <numbers>

#include "io/simulation/random.h"

namespace felt {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

Finish plain(uint16_t material, Rgba8 color) {
  const auto darker = [](uint8_t c) { return uint8_t(c * 7 / 10); };
  return {material, {Pattern::plain, color, {darker(color.r), darker(color.g), darker(color.b), 255}, 0.3}};
}

}  // namespace

void add_table(SceneBuilder& b, const Isometry3d& T, double length_m, double width_m, const Finish& finish) {
  b.begin("table", kTable, T);
  b.box({0, 0, 0.72}, {length_m, width_m, 0.04}, finish);
  for (const double sx : {-1.0, 1.0})
    for (const double sy : {-1.0, 1.0})
      b.box({sx * (length_m / 2 - 0.06), sy * (width_m / 2 - 0.06), 0.35}, {0.06, 0.06, 0.70}, finish);
}

void add_round_table(SceneBuilder& b, const Isometry3d& T, double radius_m, double height_m, const Finish& finish) {
  b.begin("round table", kTable, T);
  b.cylinder({0, 0, height_m - 0.02}, radius_m, 0.04, finish);
  b.cylinder({0, 0, height_m / 2 - 0.02}, 0.05, height_m - 0.04, finish);
  b.cylinder({0, 0, 0.015}, radius_m * 0.6, 0.03, finish);
}

void add_chair(SceneBuilder& b, const Isometry3d& T, const Finish& seat, const Finish& legs) {
  b.begin("chair", kChair, T);
  b.box({0, 0, 0.45}, {0.44, 0.44, 0.04}, seat);
  b.box({-0.215, 0, 0.70}, {0.03, 0.42, 0.46}, seat, -0.12);
  for (const double sx : {-1.0, 1.0})
    for (const double sy : {-1.0, 1.0}) b.cylinder({sx * 0.18, sy * 0.18, 0.215}, 0.022, 0.43, legs);
}

void add_sofa(SceneBuilder& b, const Isometry3d& T, double width_m, const Finish& cover, const Finish& pillow) {
  b.begin("sofa", kSofa, T);
  b.box({0, 0, 0.15}, {0.86, width_m, 0.22}, cover);
  b.box({-0.33, 0, 0.55}, {0.20, width_m, 0.58}, cover);
  for (const double side : {-1.0, 1.0}) {
    b.box({0, side * (width_m / 2 - 0.09), 0.32}, {0.86, 0.18, 0.56}, cover);
    const double inner_m = width_m - 0.36;
    b.box({0.10, side * inner_m / 4, 0.34}, {0.66, inner_m / 2 - 0.015, 0.16}, cover);
  }
  b.begin_same_place("pillow", kPillow);
  for (const double side : {-1.0, 1.0})
    b.box({-0.10, side * (width_m / 2 - 0.42), 0.60}, {0.12, 0.40, 0.38}, pillow, -0.30);
}

void add_bed(SceneBuilder& b, const Isometry3d& T, double width_m, const Finish& frame, const Finish& blanket) {
  const Finish linen = plain(kFabric, {238, 236, 228, 255});
  b.begin("bed", kBed, T);
  b.box({0, 0, 0.17}, {2.06, width_m + 0.06, 0.18}, frame);
  b.box({-1.03, 0, 0.50}, {0.06, width_m + 0.06, 0.84}, frame);
  for (const double sx : {-1.0, 1.0})
    for (const double sy : {-1.0, 1.0}) b.box({sx * 0.95, sy * (width_m / 2 - 0.05), 0.04}, {0.08, 0.08, 0.08}, frame);
  b.box({0, 0, 0.36}, {2.0, width_m, 0.20}, linen);
  b.box({0.30, 0, 0.475}, {1.38, width_m + 0.04, 0.05}, blanket);
  b.begin_same_place("pillow", kPillow);
  const int pillows = width_m > 1.2 ? 2 : 1;
  for (int i = 0; i < pillows; ++i)
    b.box({-0.72, (i - (pillows - 1) / 2.0) * width_m / 2, 0.52}, {0.42, 0.58, 0.14}, linen, 0.25);
}

void add_bookshelf(SceneBuilder& b, const Isometry3d& T, double width_m, double height_m, const Finish& finish,
                   uint64_t seed) {
  constexpr double kDepth_m = 0.30, kBoard_m = 0.025;
  const int rows = std::max(1, int(height_m / 0.38));
  const double row_m = (height_m - kBoard_m) / rows;
  b.begin("bookshelf", kBookshelf, T);
  for (const double side : {-1.0, 1.0})
    b.box({0, side * (width_m - kBoard_m) / 2, height_m / 2}, {kDepth_m, kBoard_m, height_m}, finish);
  b.box({-kDepth_m / 2 + 0.006, 0, height_m / 2}, {0.012, width_m - 2 * kBoard_m, height_m}, finish);
  for (int row = 0; row <= rows; ++row)
    b.box({0.006, 0, row * row_m + kBoard_m / 2}, {kDepth_m - 0.012, width_m - 2 * kBoard_m, kBoard_m}, finish);
  b.begin_same_place("books", kBooks);
  constexpr Rgba8 kCovers[] = {{170, 58, 52, 255},   {38, 84, 124, 255},  {232, 196, 104, 255}, {68, 112, 84, 255},
                               {222, 214, 200, 255}, {104, 70, 110, 255}, {214, 120, 60, 255},  {60, 60, 72, 255}};
  for (int row = 0; row < rows; ++row) {
    double y = -width_m / 2 + kBoard_m + 0.02;
    for (int i = 0; i < 40; ++i) {
      const uint64_t bits = random_bits(seed, 7, uint64_t(row), uint64_t(i));
      const double thick_m = 0.03 + 0.04 * uniform01(bits), tall_m = row_m * (0.55 + 0.3 * uniform01(mix64(bits)));
      if (y + thick_m > width_m / 2 - kBoard_m - 0.02) break;
      // Every fourth place or so is a gap.
      if (bits % 4 != 0) {
        const double deep_m = 0.16 + 0.06 * uniform01(mix64(bits + 1));
        b.box({-0.03, y + thick_m / 2, row * row_m + kBoard_m + tall_m / 2}, {deep_m, thick_m - 0.004, tall_m},
              plain(kPaper, kCovers[mix64(bits + 2) % 8]));
      }
      y += thick_m;
    }
  }
}

void add_cabinet(SceneBuilder& b, const Isometry3d& T, double width_m, double height_m, const Finish& finish) {
  constexpr double kDepth_m = 0.42;
  const Finish knob = plain(kMetal, {190, 185, 170, 255});
  b.begin("cabinet", kCabinet, T);
  b.box({0, 0, height_m / 2}, {kDepth_m, width_m, height_m}, finish);
  const int doors = std::max(2, int(std::lround(width_m / 0.45)));
  const double door_m = width_m / doors;
  for (int i = 0; i < doors; ++i) {
    const double y = -width_m / 2 + (i + 0.5) * door_m;
    b.box({kDepth_m / 2 + 0.01, y, height_m / 2 + 0.02}, {0.02, door_m - 0.03, height_m - 0.12}, finish);
    b.sphere({kDepth_m / 2 + 0.035, y + (i % 2 == 0 ? 1 : -1) * door_m * 0.35, height_m * 0.6}, 0.018, knob);
  }
}

void add_television(SceneBuilder& b, const Isometry3d& T, double width_m) {
  const Finish frame = plain(kPlastic, {34, 34, 38, 255});
  const Finish screen = {kPlastic, {Pattern::picture, {20, 32, 60, 255}, {60, 110, 120, 255}, width_m / 4}};
  b.begin("television", kTelevision, T);
  b.box({0, 0, 0.01}, {0.20, width_m * 0.4, 0.02}, frame);
  b.box({0, 0, 0.05}, {0.04, 0.08, 0.08}, frame);
  b.box({0, 0, 0.09 + width_m * 0.29}, {0.05, width_m, width_m * 0.58}, frame);
  b.box({0.03, 0, 0.09 + width_m * 0.29}, {0.01, width_m - 0.05, width_m * 0.58 - 0.05}, screen);
}

void add_floor_lamp(SceneBuilder& b, const Isometry3d& T) {
  const Finish metal = plain(kMetal, {150, 140, 120, 255});
  b.begin("floor lamp", kLamp, T);
  b.cylinder({0, 0, 0.015}, 0.16, 0.03, metal);
  b.cylinder({0, 0, 0.72}, 0.016, 1.38, metal);
  b.cylinder({0, 0, 1.54}, 0.21, 0.30, {kFabric, {Pattern::stripes, {250, 236, 196, 255}, {236, 208, 150, 255}, 0.05}});
}

void add_rug(SceneBuilder& b, const Isometry3d& T, double length_m, double width_m, const Finish& finish) {
  b.begin("rug", kFloorMat, T);
  b.box({0, 0, 0.008}, {length_m, width_m, 0.016}, finish);
}

void add_plant(SceneBuilder& b, const Isometry3d& T, double height_m) {
  const Finish leaves = {kFoliage, {Pattern::noise, {38, 92, 48, 255}, {122, 172, 82, 255}, 0.05}};
  b.begin("plant", kOtherProp, T);
  b.cylinder({0, 0, 0.16}, 0.15, 0.32, plain(kCeramic, {196, 110, 78, 255}));
  b.cylinder({0, 0, 0.32 + (height_m - 0.5) / 2}, 0.02, height_m - 0.5, plain(kWood, {98, 74, 50, 255}));
  const double r = 0.24;
  b.sphere({0, 0, height_m - r}, r, leaves);
  for (int i = 0; i < 4; ++i) {
    const double angle = 1.571 * i + 0.4;
    b.sphere({0.17 * std::cos(angle), 0.17 * std::sin(angle), height_m - 0.36 - 0.05 * i}, 0.15, leaves);
  }
}

void add_grass_planter(SceneBuilder& b, const Isometry3d& T, double length_m) {
  b.begin("planter", kOtherFurniture, T);
  b.box({0, 0, 0.15}, {0.40, length_m, 0.30}, plain(kPlastic, {72, 76, 84, 255}));
  b.begin_same_place("grass", kOtherProp);
  b.box({0, 0, 0.33}, {0.34, length_m - 0.06, 0.10},
        {kGrass, {Pattern::noise, {52, 118, 44, 255}, {150, 196, 92, 255}, 0.03}});
}

void add_hearth(SceneBuilder& b, const Isometry3d& T) {
  const Finish stone = {kRock, {Pattern::tiles, {142, 132, 122, 255}, {92, 88, 86, 255}, 0.22}};
  b.begin("hearth", kOtherFurniture, T);
  b.box({0, 0, 0.06}, {0.60, 1.40, 0.12}, stone);
  for (const double side : {-1.0, 1.0}) b.box({-0.08, side * 0.52, 0.57}, {0.44, 0.32, 0.90}, stone);
  b.box({-0.08, 0, 1.10}, {0.48, 1.40, 0.16}, stone);
  b.box({-0.26, 0, 0.57}, {0.08, 0.72, 0.90}, plain(kRock, {56, 52, 50, 255}));
}

void add_crate(SceneBuilder& b, const Isometry3d& T, double size_m, const Finish& finish) {
  b.begin("crate", kBox, T);
  b.box({0, 0, size_m * 0.4}, {size_m, size_m * 1.2, size_m * 0.8}, finish);
}

void add_ball(SceneBuilder& b, const Isometry3d& T, double radius_m, const Finish& finish) {
  b.begin("ball", kOtherProp, T);
  b.sphere({0, 0, radius_m}, radius_m, finish);
}

void add_pouf(SceneBuilder& b, const Isometry3d& T, const Finish& finish) {
  b.begin("pouf", kOtherFurniture, T);
  b.cylinder({0, 0, 0.20}, 0.28, 0.40, finish);
}

void add_door(SceneBuilder& b, const Isometry3d& T, const Finish& leaf) {
  const Finish frame = plain(kWood, {236, 230, 218, 255});
  b.begin("door", kDoor, T);
  b.box({0.02, 0, 1.01}, {0.04, 0.84, 2.02}, leaf);
  for (const double side : {-1.0, 1.0}) b.box({0.025, side * 0.46, 1.05}, {0.05, 0.08, 2.10}, frame);
  b.box({0.025, 0, 2.06}, {0.05, 0.84, 0.08}, frame);
  for (const double z : {0.56, 1.50}) b.box({0.045, 0, z}, {0.01, 0.58, z < 1 ? 0.72 : 0.82}, leaf);
  b.box({0.06, 0.36, 1.02}, {0.04, 0.02, 0.02}, plain(kMetal, {200, 196, 184, 255}));
  b.sphere({0.09, 0.36, 1.02}, 0.028, plain(kMetal, {200, 196, 184, 255}));
}

void add_window(SceneBuilder& b, const Isometry3d& T, double width_m, double height_m) {
  const Finish frame = plain(kPlastic, {240, 240, 236, 255});
  const double z = 0.95 + height_m / 2;
  b.begin("window", kWindow, T);
  b.box({0.01, 0, z}, {0.02, width_m, height_m},
        {kGlass, {Pattern::picture, {156, 200, 236, 255}, {96, 146, 84, 255}, height_m / 2.2}});
  for (const double side : {-1.0, 1.0}) {
    b.box({0.025, side * (width_m / 2 + 0.03), z}, {0.05, 0.06, height_m + 0.12}, frame);
    b.box({0.025, 0, z + side * (height_m / 2 + 0.03)}, {0.05, width_m, 0.06}, frame);
  }
  b.box({0.025, 0, z}, {0.05, 0.04, height_m}, frame);
  b.box({0.09, 0, z - height_m / 2 - 0.08}, {0.18, width_m + 0.2, 0.04}, frame);
}

void add_picture(SceneBuilder& b, const Isometry3d& T, double width_m, double height_m, Rgba8 sky, Rgba8 land) {
  b.begin("picture", kPicture, T);
  b.box({0.01, 0, 1.55}, {0.02, width_m + 0.08, height_m + 0.08}, plain(kWood, {64, 48, 36, 255}));
  b.box({0.015, 0, 1.55}, {0.03, width_m, height_m}, {kPaper, {Pattern::picture, sky, land, height_m / 2.5}});
}

void add_room_shell(SceneBuilder& b, Scene& scene, const Vector3d& size_m, const Finish& floor, const Finish& walls,
                    const Finish& skirting) {
  const double lx = size_m.x(), ly = size_m.y(), lz = size_m.z(), half_turn = std::numbers::pi;
  scene.bounds = {Vector3d(-lx / 2, -ly / 2, 0), Vector3d(lx / 2, ly / 2, lz)};
  scene.light_m = {0, 0, lz - 0.35};
  b.begin("floor", kFloor, Isometry3d::Identity());
  b.plane(lx, ly, floor);
  Isometry3d down = Isometry3d::Identity();
  down.linear() = Eigen::AngleAxisd(half_turn, Vector3d::UnitX()).toRotationMatrix();
  down.translation().z() = lz;
  b.begin("ceiling", kCeiling, down);
  b.plane(lx, ly, plain(kPaint, {240, 238, 232, 255}));
  for (int side = 0; side < 4; ++side) {
    const double yaw = side * half_turn / 2, length_m = side % 2 == 0 ? ly : lx,
                 away_m = side % 2 == 0 ? lx / 2 : ly / 2;
    // Thing's z is the wall's normal, its x is along the wall, its y points up.
    const Vector3d inward(-std::cos(yaw), -std::sin(yaw), 0);
    Isometry3d wall = Isometry3d::Identity();
    wall.linear() << Vector3d::UnitZ().cross(inward), Vector3d::UnitZ(), inward;
    wall.translation() = -inward * away_m + Vector3d(0, 0, lz / 2);
    b.begin("wall", kWall, wall);
    b.plane(length_m, lz, walls);
    b.box({0, -lz / 2 + 0.04, 0.006}, {length_m, 0.08, 0.012}, skirting);
  }
}

}  // namespace felt
