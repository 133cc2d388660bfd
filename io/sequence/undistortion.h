#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <string>

#include "core/camera.h"
#include "core/image.h"

namespace felt {

/// Radial-tangential lens distortion (Brown 1966), coefficients as in OpenCV: with x = X/Z, y = Y/Z, r^2 = x^2 + y^2,
/// x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2),
/// y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y.
struct Distortion {
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;
  bool operator==(const Distortion&) const = default;
  bool none() const { return *this == Distortion{}; }
};

/// Reads "k1,k2,p1,p2" or "k1,k2,p1,p2,k3". Throws ConfigError.
Distortion parse_distortion(const std::string& text, const std::string& where);

/// Where the ray (x, y, 1) falls in the distorted image, real pixel coordinates; NaN beyond the radius at which the
/// model folds back and no lens is described any more.
Eigen::Vector2d project_distorted(const PinholeCamera& camera, const Distortion& distortion, double x, double y);

/// For each pixel of the undistorted image of the same camera, the nearest pixel (row * width + column) of the
/// distorted one, -1 where it lies outside.
Image<int32_t> undistortion_map(const PinholeCamera& camera, const Distortion& distortion);

/// Each pixel from where the map says, `outside` where it says -1. Sizes are equal. Nearest pixels, so that depth,
/// labels and colour of one pixel stay together and no value is invented between two surfaces.
template <typename Pixel>
Image<Pixel> undistorted(const Image<Pixel>& image, const Image<int32_t>& map, Pixel outside) {
  Image<Pixel> result(image.width(), image.height(), outside);
  for (size_t p = 0; p < map.size(); ++p)
    if (const int32_t from = map.data()[p]; from >= 0) result.data()[p] = image.data()[from];
  return result;
}

}  // namespace felt
