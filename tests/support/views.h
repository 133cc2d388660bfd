#pragma once

#include <cmath>
#include <cstdint>

#include "core/frame.h"

namespace felt::test {

/// Reproducible uniform numbers in [0, 1).
struct Random {
  uint64_t state;
  explicit Random(uint64_t seed) : state(seed * 0x9e3779b97f4a7c15ull + 1) {}
  double operator()() {
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    return double(state >> 11) * 0x1p-53;
  }
  double between(double low, double high) { return low + (high - low) * (*this)(); }
};

/// A ball of `radius` metres in front of a wall z = `wall_z`, seen along +z from `T_world_camera`, exact depth.
/// Colour is a function of the world point, so that fused colours can be checked.
inline Frame ball_before_wall(const Eigen::Isometry3d& T_world_camera, int width = 160, int height = 120,
                              double radius = 0.3, double wall_z = 2.0, Eigen::Vector3d center = {0, 0, 1.4}) {
  Frame frame;
  frame.camera = {0.9 * width, 0.9 * width, 0.5 * width - 0.5, 0.5 * height - 0.5, width, height};
  frame.T_world_camera = T_world_camera;
  frame.depth_m = DepthImage(width, height);
  frame.color = ColorImage(width, height);
  const Eigen::Vector3d o = T_world_camera.translation();
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const Eigen::Vector3d r = T_world_camera.linear() * frame.camera.ray(u, v);
      double t = r.z() > 0 ? (wall_z - o.z()) / r.z() : 0;
      const Eigen::Vector3d to = o - center;
      const double a = r.squaredNorm(), b = to.dot(r), c = to.squaredNorm() - radius * radius;
      const bool hit = b * b - a * c > 0 && -b - std::sqrt(b * b - a * c) > 0;
      if (hit) t = (-b - std::sqrt(b * b - a * c)) / a;
      frame.depth_m(u, v) = float(t);  // r has unit z in the camera frame, so t is the depth
      frame.color(u, v) = hit ? Rgba8{200, 40, 90, 255} : Rgba8{20, 130, 250, 255};
    }
  return frame;
}

/// A view from near the origin along +z, jittered.
inline Eigen::Isometry3d jittered_pose(Random& random) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() << random.between(-.2, .2), random.between(-.2, .2), random.between(-.2, .2);
  const Eigen::Vector3d axis =
      Eigen::Vector3d(random.between(-1, 1), random.between(-1, 1), random.between(-1, 1)).normalized();
  T.linear() = Eigen::AngleAxisd(random.between(-.3, .3), axis).matrix();
  return T;
}

}  // namespace felt::test
