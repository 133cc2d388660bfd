#include "io/simulation/furniture.h"

namespace felt {

using Eigen::Isometry3d;
using Eigen::Vector3d;

ClassTable simulated_semantics() {
  return ClassTable({{0, "none", {0, 0, 0, 255}, true},
                     {kWall, "wall", {174, 199, 232, 255}},
                     {kFloor, "floor", {152, 223, 138, 255}},
                     {kCabinet, "cabinet", {31, 119, 180, 255}},
                     {kBed, "bed", {255, 187, 120, 255}},
                     {kChair, "chair", {188, 189, 34, 255}},
                     {kSofa, "sofa", {140, 86, 75, 255}},
                     {kTable, "table", {255, 152, 150, 255}},
                     {kDoor, "door", {214, 39, 40, 255}},
                     {kWindow, "window", {197, 176, 213, 255}},
                     {kBookshelf, "bookshelf", {148, 103, 189, 255}},
                     {kPicture, "picture", {196, 156, 148, 255}},
                     {kPillow, "pillow", {141, 91, 229, 255}},
                     {kFloorMat, "floor mat", {237, 204, 37, 255}},
                     {kCeiling, "ceiling", {202, 214, 224, 255}},
                     {kBooks, "books", {92, 193, 61, 255}},
                     {kTelevision, "television", {78, 71, 183, 255}},
                     {kBox, "box", {51, 176, 203, 255}},
                     {kLamp, "lamp", {153, 108, 234, 255}},
                     {kOtherFurniture, "other furniture", {255, 127, 14, 255}},
                     {kOtherProp, "other prop", {44, 160, 44, 255}}});
}

ClassTable simulated_materials() {
  return ClassTable({{0, "none", {0, 0, 0, 255}, true},
                     {kConcrete, "concrete", {150, 150, 150, 255}},
                     {kGrass, "grass", {88, 168, 60, 255}},
                     {kRock, "rock", {112, 92, 84, 255}},
                     {kWood, "wood", {190, 130, 70, 255}},
                     {kRubber, "rubber", {60, 60, 64, 255}},
                     {kPlastic, "plastic", {228, 108, 90, 255}},
                     {kSnow, "snow", {236, 240, 248, 255}},
                     {kIce, "ice", {136, 204, 238, 255}},
                     {kFabric, "fabric", {170, 80, 150, 255}},
                     {kGlass, "glass", {120, 220, 210, 255}},
                     {kMetal, "metal", {92, 120, 160, 255}},
                     {kPaint, "paint", {240, 220, 180, 255}},
                     {kPaper, "paper", {250, 250, 150, 255}},
                     {kFoliage, "foliage", {30, 110, 50, 255}},
                     {kCeramic, "ceramic", {200, 90, 40, 255}}});
}

Isometry3d floor_pose(double x_m, double y_m, double yaw_rad, double z_m) {
  Isometry3d T = Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(yaw_rad, Vector3d::UnitZ()).toRotationMatrix();
  T.translation() = Vector3d(x_m, y_m, z_m);
  return T;
}

void SceneBuilder::begin(const std::string& thing, uint16_t semantic, const Isometry3d& T_world_thing) {
  T_world_thing_ = T_world_thing;
  begin_same_place(thing, semantic);
}

void SceneBuilder::begin_same_place(const std::string& thing, uint16_t semantic) {
  thing_ = thing;
  semantic_ = semantic;
  ++instance_;
}

void SceneBuilder::add(ShapeKind shape, const Vector3d& half_size_m, const Isometry3d& T_thing_shape,
                       const Finish& finish) {
  scene_.primitives.push_back({thing_, shape, half_size_m, T_world_thing_ * T_thing_shape, semantic_, finish.material,
                               instance_, finish.texture});
}

void SceneBuilder::box(const Vector3d& center_m, const Vector3d& size_m, const Finish& finish, double pitch_rad,
                       double yaw_rad) {
  Isometry3d T = Isometry3d::Identity();
  T.linear() = (Eigen::AngleAxisd(yaw_rad, Vector3d::UnitZ()) * Eigen::AngleAxisd(pitch_rad, Vector3d::UnitY()))
                   .toRotationMatrix();
  T.translation() = center_m;
  add(ShapeKind::box, size_m / 2, T, finish);
}

void SceneBuilder::cylinder(const Vector3d& center_m, double radius_m, double height_m, const Finish& finish) {
  add(ShapeKind::cylinder, {radius_m, radius_m, height_m / 2}, Isometry3d(Eigen::Translation3d(center_m)), finish);
}

void SceneBuilder::sphere(const Vector3d& center_m, double radius_m, const Finish& finish) {
  add(ShapeKind::sphere, Vector3d::Constant(radius_m), Isometry3d(Eigen::Translation3d(center_m)), finish);
}

void SceneBuilder::plane(double size_x_m, double size_y_m, const Finish& finish) {
  add(ShapeKind::plane, {size_x_m / 2, size_y_m / 2, 0}, Isometry3d::Identity(), finish);
}

}  // namespace felt
