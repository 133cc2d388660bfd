#pragma once

#include <Eigen/Geometry>

namespace felt {

/// Pinhole camera, OpenCV axes: x right, y down, z forward. The centre of pixel (u, v) is at the real coordinates (u,
/// v): u = fx x / z + cx, v = fy y / z + cy; the nearest pixel is floor(u + 0.5).
struct PinholeCamera {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels
  int width = 0, height = 0;              ///< pixels

  /// Direction (x/z, y/z, 1) through real pixel coordinates (u, v).
  Eigen::Vector3d ray(double u, double v) const { return {(u - cx) / fx, (v - cy) / fy, 1.0}; }
  /// Real pixel coordinates of a point in the camera frame with z > 0.
  Eigen::Vector2d project(const Eigen::Vector3d& p) const { return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy}; }
  bool operator==(const PinholeCamera&) const = default;
};

/// The camera that sees the same rays in an image of another size.
inline PinholeCamera resized(const PinholeCamera& camera, int width, int height) {
  const double sx = double(width) / camera.width, sy = double(height) / camera.height;
  // A pixel centre sits at integer coordinates, so the image's edge is at -0.5.
  return {camera.fx * sx, camera.fy * sy, (camera.cx + 0.5) * sx - 0.5, (camera.cy + 0.5) * sy - 0.5, width, height};
}

}  // namespace felt
