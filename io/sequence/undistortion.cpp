#include "io/sequence/undistortion.h"

#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {

Distortion parse_distortion(const std::string& text, const std::string& where) {
  std::vector<double> numbers;
  const auto words = split_words(text, ',');
  for (const std::string_view word : words)
    if (const auto number = parse_number(word); number && std::isfinite(*number)) numbers.push_back(*number);
  if (numbers.size() != words.size() || (numbers.size() != 4 && numbers.size() != 5))
    throw ConfigError(describe_mismatch(where, "distortion", "k1,k2,p1,p2 or k1,k2,p1,p2,k3", "'" + text + "'"));
  numbers.resize(5);
  return {numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]};
}

Eigen::Vector2d project_distorted(const PinholeCamera& camera, const Distortion& d, double x, double y) {
  const double r2 = x * x + y * y;
  // Derivative of the distorted radius r (1 + k1 r^2 + ...): where it is not positive the image folds.
  if (!(1 + r2 * (3 * d.k1 + r2 * (5 * d.k2 + r2 * 7 * d.k3)) > 0))
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
  const double xd = x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x),
               yd = y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y;
  return {camera.fx * xd + camera.cx, camera.fy * yd + camera.cy};
}

Image<int32_t> undistortion_map(const PinholeCamera& camera, const Distortion& distortion) {
  Image<int32_t> map(camera.width, camera.height, -1);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray = camera.ray(u, v);
      const Eigen::Vector2d pixel = project_distorted(camera, distortion, ray.x(), ray.y());
      const double x = std::floor(pixel.x() + 0.5), y = std::floor(pixel.y() + 0.5);
      if (x >= 0 && y >= 0 && x < camera.width && y < camera.height) map(u, v) = int32_t(y) * camera.width + int32_t(x);
    }
  return map;
}

}  // namespace felt
