#pragma once

#include <string>

#include "io/simulation/scene.h"

namespace felt {

/// Semantic ids are NYU40's; only those that the scenes use are in the table.
enum SemanticId : uint16_t {
  kWall = 1,
  kFloor = 2,
  kCabinet = 3,
  kBed = 4,
  kChair = 5,
  kSofa = 6,
  kTable = 7,
  kDoor = 8,
  kWindow = 9,
  kBookshelf = 10,
  kPicture = 11,
  kPillow = 18,
  kFloorMat = 20,
  kCeiling = 22,
  kBooks = 23,
  kTelevision = 25,
  kBox = 29,
  kLamp = 35,
  kOtherFurniture = 39,
  kOtherProp = 40,
};
/// The first eight are the materials of Table I of Ewen et al. 2024, in its order.
enum MaterialId : uint16_t {
  kConcrete = 1,
  kGrass,
  kRock,
  kWood,
  kRubber,
  kPlastic,
  kSnow,
  kIce,
  kFabric,
  kGlass,
  kMetal,
  kPaint,
  kPaper,
  kFoliage,
  kCeramic,
};
ClassTable simulated_semantics();
ClassTable simulated_materials();

/// What a part is made of and how it is painted.
struct Finish {
  uint16_t material = kWood;
  Texture texture;
};

/// Adds solids to a scene thing by thing. Parts are given in the thing's frame: origin on the floor, x to its front.
class SceneBuilder {
public:
  explicit SceneBuilder(Scene& scene) : scene_(scene) {}

  /// The parts that follow belong to a new instance at this pose.
  void begin(const std::string& thing, uint16_t semantic, const Eigen::Isometry3d& T_world_thing);
  /// The parts that follow belong to another new instance at the same pose (cushions of a sofa, books of a shelf).
  void begin_same_place(const std::string& thing, uint16_t semantic);
  void box(const Eigen::Vector3d& center_m, const Eigen::Vector3d& size_m, const Finish& finish, double pitch_rad = 0,
           double yaw_rad = 0);
  void cylinder(const Eigen::Vector3d& center_m, double radius_m, double height_m, const Finish& finish);
  void sphere(const Eigen::Vector3d& center_m, double radius_m, const Finish& finish);
  /// Half-space below the patch; its normal is the thing's z axis.
  void plane(double size_x_m, double size_y_m, const Finish& finish);

private:
  void add(ShapeKind shape, const Eigen::Vector3d& half_size_m, const Eigen::Isometry3d& T_thing_shape,
           const Finish& finish);

  Scene& scene_;
  std::string thing_;
  uint16_t semantic_ = 0, instance_ = 0;
  Eigen::Isometry3d T_world_thing_ = Eigen::Isometry3d::Identity();
};

/// On the floor at (x, y), front turned by `yaw_rad` from world x; `z_m`: the height of what it stands on.
Eigen::Isometry3d floor_pose(double x_m, double y_m, double yaw_rad, double z_m = 0);

/// Furniture. `T` is the thing's pose; sizes in metres.
void add_table(SceneBuilder& b, const Eigen::Isometry3d& T, double length_m, double width_m, const Finish& finish);
void add_round_table(SceneBuilder& b, const Eigen::Isometry3d& T, double radius_m, double height_m,
                     const Finish& finish);
void add_chair(SceneBuilder& b, const Eigen::Isometry3d& T, const Finish& seat, const Finish& legs);
void add_sofa(SceneBuilder& b, const Eigen::Isometry3d& T, double width_m, const Finish& cover, const Finish& pillow);
void add_bed(SceneBuilder& b, const Eigen::Isometry3d& T, double width_m, const Finish& frame, const Finish& blanket);
void add_bookshelf(SceneBuilder& b, const Eigen::Isometry3d& T, double width_m, double height_m, const Finish& finish,
                   uint64_t seed);
void add_cabinet(SceneBuilder& b, const Eigen::Isometry3d& T, double width_m, double height_m, const Finish& finish);
void add_television(SceneBuilder& b, const Eigen::Isometry3d& T, double width_m);
void add_floor_lamp(SceneBuilder& b, const Eigen::Isometry3d& T);
void add_rug(SceneBuilder& b, const Eigen::Isometry3d& T, double length_m, double width_m, const Finish& finish);
void add_plant(SceneBuilder& b, const Eigen::Isometry3d& T, double height_m);
void add_grass_planter(SceneBuilder& b, const Eigen::Isometry3d& T, double length_m);
void add_hearth(SceneBuilder& b, const Eigen::Isometry3d& T);
void add_crate(SceneBuilder& b, const Eigen::Isometry3d& T, double size_m, const Finish& finish);
void add_ball(SceneBuilder& b, const Eigen::Isometry3d& T, double radius_m, const Finish& finish);
void add_pouf(SceneBuilder& b, const Eigen::Isometry3d& T, const Finish& finish);
/// On a wall: `T` has its origin on the floor at the wall, x pointing into the room.
void add_door(SceneBuilder& b, const Eigen::Isometry3d& T, const Finish& leaf);
void add_window(SceneBuilder& b, const Eigen::Isometry3d& T, double width_m, double height_m);
void add_picture(SceneBuilder& b, const Eigen::Isometry3d& T, double width_m, double height_m, Rgba8 sky, Rgba8 land);

/// Floor, ceiling, four walls with skirting boards; sets the scene's bounds. Centred on the origin, floor at z = 0.
void add_room_shell(SceneBuilder& b, Scene& scene, const Eigen::Vector3d& size_m, const Finish& floor,
                    const Finish& walls, const Finish& skirting);

}  // namespace felt
