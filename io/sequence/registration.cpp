#include "io/sequence/registration.h"

#include <cmath>
#include <vector>

namespace felt {
namespace {

/// Nearest pixel number of a real coordinate, -1 outside [0, size).
int nearest_pixel(double coordinate, int size) {
  const double pixel = std::floor(coordinate + 0.5);
  return pixel >= 0 && pixel < size ? int(pixel) : -1;
}

}  // namespace

template <typename Pixel>
Image<Pixel> registered_to_depth(const Image<Pixel>& image, const PinholeCamera& camera, const DepthImage& depth_m,
                                 const PinholeCamera& depth_camera, const Eigen::Matrix4d& T_image_depth, Pixel outside,
                                 const Distortion& distortion) {
  const int width = depth_camera.width, height = depth_camera.height;
  Image<Pixel> registered(width, height, outside);
  const bool same_place = T_image_depth.isIdentity(0);
  if (same_place && distortion.none()) {
    std::vector<int> column(static_cast<size_t>(width));
    for (int u = 0; u < width; ++u)
      column[size_t(u)] = nearest_pixel(camera.project(depth_camera.ray(u, 0)).x(), image.width());
    for (int v = 0; v < height; ++v) {
      const int source_row = nearest_pixel(camera.project(depth_camera.ray(0, v)).y(), image.height());
      if (source_row < 0) continue;
      const Pixel* const from = image.row(source_row);
      Pixel* const to = registered.row(v);
      for (int u = 0; u < width; ++u)
        if (column[size_t(u)] >= 0) to[u] = from[column[size_t(u)]];
    }
    return registered;
  }
  const Eigen::Matrix3d R = T_image_depth.topLeftCorner<3, 3>();
  const Eigen::Vector3d t = T_image_depth.topRightCorner<3, 1>();
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const double z = same_place ? 1.0 : double(depth_m(u, v));
      if (z <= 0) continue;
      const Eigen::Vector3d p = R * (z * depth_camera.ray(u, v)) + t;
      if (p.z() <= 0) continue;
      const Eigen::Vector2d pixel = project_distorted(camera, distortion, p.x() / p.z(), p.y() / p.z());
      const int x = nearest_pixel(pixel.x(), image.width()), y = nearest_pixel(pixel.y(), image.height());
      if (x >= 0 && y >= 0) registered(u, v) = image(x, y);
    }
  return registered;
}

template Image<Rgba8> registered_to_depth(const Image<Rgba8>&, const PinholeCamera&, const DepthImage&,
                                          const PinholeCamera&, const Eigen::Matrix4d&, Rgba8, const Distortion&);
template Image<uint16_t> registered_to_depth(const Image<uint16_t>&, const PinholeCamera&, const DepthImage&,
                                             const PinholeCamera&, const Eigen::Matrix4d&, uint16_t, const Distortion&);

}  // namespace felt
