#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/class_table.h"

namespace felt {

/// The solids a scene is made of, each in its own frame.
enum class ShapeKind : uint8_t {
  plane,     ///< half-space z <= 0; `half_size_m` x, y: the patch that the mesh shows
  box,       ///< |x|, |y|, |z| <= half_size_m
  sphere,    ///< radius half_size_m.x
  cylinder,  ///< axis z, radius half_size_m.x, |z| <= half_size_m.z
};

/// How a surface is painted, as a function of the point in the shape's frame.
enum class Pattern : uint8_t { plain, checker, noise, wood, tiles, stripes, picture };

struct Texture {
  Pattern pattern = Pattern::plain;
  Rgba8 first, second;   ///< sRGB; the pattern mixes them
  double scale_m = 0.2;  ///< size of one feature of the pattern
  bool operator==(const Texture&) const = default;
};

/// One solid. Plain data: a scene is a list of these.
struct Primitive {
  std::string name;
  ShapeKind shape = ShapeKind::box;
  Eigen::Vector3d half_size_m = Eigen::Vector3d::Constant(0.5);
  Eigen::Isometry3d T_world_shape = Eigen::Isometry3d::Identity();
  uint16_t semantic = 0;  ///< id in `Scene::semantics`
  uint16_t material = 0;  ///< id in `Scene::materials`
  uint16_t instance = 0;  ///< parts of one thing share it; > 0
  Texture texture;
};

/// A place of the standard camera path and what the camera looks at there. World frame, metres.
struct WayPoint {
  Eigen::Vector3d position_m, look_at_m;
};

/// A world of solids, z up, metres. Their union is solid, the rest is free.
struct Scene {
  std::string name, description;
  std::vector<Primitive> primitives;
  Eigen::AlignedBox3d bounds;  ///< the part of the world that the scene is about: the mesh ends here
  Eigen::Vector3d light_m = {0, 0, 2.4};
  std::vector<WayPoint> path;  ///< of the standard trajectory
  ClassTable semantics, materials;
};

/// Signed distance from a world point to one solid, metres, exact, positive outside.
double signed_distance_m(const Primitive& primitive, const Eigen::Vector3d& p_world);

struct NearestSurface {
  double distance_m = 0;  ///< signed
  int primitive = -1;     ///< index in `Scene::primitives`
};

/// Signed distance to the union. Exact outside of the solids (the smallest of the exact distances); inside, where
/// solids overlap or touch, its magnitude is a lower bound of the distance to the union's surface. Ties go to the first
/// solid.
NearestSurface nearest_surface(const Scene& scene, const Eigen::Vector3d& p_world);
double signed_distance_m(const Scene& scene, const Eigen::Vector3d& p_world);

}  // namespace felt
