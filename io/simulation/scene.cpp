#include "io/simulation/scene.h"

#include <cmath>

namespace felt {
namespace {

/// Distance to |a| <= half_a, |b| <= half_b given the excesses q = |.| - half: the sum rule shared by box and cylinder.
double from_excess(double qx, double qy, double qz) {
  const double ox = std::max(qx, 0.0), oy = std::max(qy, 0.0), oz = std::max(qz, 0.0);
  return std::sqrt(ox * ox + oy * oy + oz * oz) + std::min(std::max(qx, std::max(qy, qz)), 0.0);
}

}  // namespace

double signed_distance_m(const Primitive& primitive, const Eigen::Vector3d& p_world) {
  const Eigen::Vector3d p =
      primitive.T_world_shape.linear().transpose() * (p_world - primitive.T_world_shape.translation());
  const Eigen::Vector3d& half = primitive.half_size_m;
  switch (primitive.shape) {
    case ShapeKind::plane:
      return p.z();
    case ShapeKind::box:
      return from_excess(std::abs(p.x()) - half.x(), std::abs(p.y()) - half.y(), std::abs(p.z()) - half.z());
    case ShapeKind::sphere:
      return p.norm() - half.x();
    case ShapeKind::cylinder:
      return from_excess(std::sqrt(p.x() * p.x() + p.y() * p.y()) - half.x(), std::abs(p.z()) - half.z(), -HUGE_VAL);
  }
  return HUGE_VAL;
}

NearestSurface nearest_surface(const Scene& scene, const Eigen::Vector3d& p_world) {
  NearestSurface best{HUGE_VAL, -1};
  for (size_t i = 0; i < scene.primitives.size(); ++i) {
    const double d = signed_distance_m(scene.primitives[i], p_world);
    if (d < best.distance_m) best = {d, int(i)};
  }
  return best;
}

double signed_distance_m(const Scene& scene, const Eigen::Vector3d& p_world) {
  return nearest_surface(scene, p_world).distance_m;
}

}  // namespace felt
