#include "io/sequence/registration.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace felt {
namespace {

/// Nearest pixel number of a real coordinate, -1 outside [0, size).
int nearest_pixel(double coordinate, int size) {
  const double pixel = std::floor(coordinate + 0.5);
  return pixel >= 0 && pixel < size ? int(pixel) : -1;
}

/// Spacing of neighbouring depth pixels in the image, and one more: no cell of this size within a surface stays empty.
int cell_px(const PinholeCamera& camera, const PinholeCamera& depth_camera) {
  return 1 + int(std::ceil(std::max(camera.fx / depth_camera.fx, camera.fy / depth_camera.fy)));
}

/// The nearest depth seen in each cell of an image: what lies clearly behind it shows another surface there.
class NearestDepth {
public:
  /// `baseline_m`: between the two cameras.
  NearestDepth(int width, int height, int cell, const PinholeCamera& camera, double baseline_m)
      : cell_(cell),
        columns_((width + cell - 1) / cell),
        // A surface seen at 80 degrees changes by so much of its depth within a cell.
        behind_(std::max(1.05f, float(1 + 5.67 * cell / std::min(camera.fx, camera.fy)))),
        baseline_px_(float(baseline_m * std::max(camera.fx, camera.fy))),
        z_(size_t(columns_) * size_t((height + cell - 1) / cell), std::numeric_limits<float>::infinity()) {}

  void add(int x, int y, float z) { at(x, y) = std::min(at(x, y), z); }
  bool hides(int x, int y, float z) {
    const float near = at(x, y);
    // Two surfaces that both cameras see side by side, within half a pixel, hide nothing from each other.
    return z > behind_ * near && baseline_px_ * (1 / near - 1 / z) > 0.5f;
  }

private:
  float& at(int x, int y) { return z_[size_t(y / cell_) * size_t(columns_) + size_t(x / cell_)]; }

  int cell_, columns_;
  float behind_, baseline_px_;
  std::vector<float> z_;
};

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
  struct Seen {
    int x = -1, y = -1;
    float z = 0;
  };
  Image<Seen> seen(width, height);
  NearestDepth nearest(image.width(), image.height(), cell_px(camera, depth_camera), camera, t.norm());
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const double z = same_place ? 1.0 : double(depth_m(u, v));
      if (z <= 0) continue;
      const Eigen::Vector3d p = R * (z * depth_camera.ray(u, v)) + t;
      if (p.z() <= 0) continue;
      const Eigen::Vector2d pixel = project_distorted(camera, distortion, p.x() / p.z(), p.y() / p.z());
      const int x = nearest_pixel(pixel.x(), image.width()), y = nearest_pixel(pixel.y(), image.height());
      if (x < 0 || y < 0) continue;
      seen(u, v) = {x, y, float(p.z())};
      nearest.add(x, y, float(p.z()));
    }
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u)
      if (const Seen& s = seen(u, v); s.x >= 0 && !nearest.hides(s.x, s.y, s.z)) registered(u, v) = image(s.x, s.y);
  return registered;
}

template Image<Rgba8> registered_to_depth(const Image<Rgba8>&, const PinholeCamera&, const DepthImage&,
                                          const PinholeCamera&, const Eigen::Matrix4d&, Rgba8, const Distortion&);
template Image<uint16_t> registered_to_depth(const Image<uint16_t>&, const PinholeCamera&, const DepthImage&,
                                             const PinholeCamera&, const Eigen::Matrix4d&, uint16_t, const Distortion&);

}  // namespace felt
