#include "io/sequence/lidar_scan.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numbers>

#include "io/images/image_decode.h"

namespace felt {
namespace {

constexpr int kRows = 64, kColumns = 2048, kFaceSize = 512;
constexpr double kRowReach = 2, kLargestRatio = 1.2;

/// Nearest range by azimuth (columns, from -pi) and elevation (rows, from the top); 0 where there is none.
struct SphericalImage {
  Image<float> range{kColumns, kRows};
  double top = 0, row_step = 1;  ///< elevation of row 0 and between rows, radians

  double column(double azimuth) const { return (azimuth + std::numbers::pi) / (2 * std::numbers::pi) * kColumns - 0.5; }
  double row(double elevation) const { return (top - elevation) / row_step; }
  float at(int u, int v) const { return range((u % kColumns + kColumns) % kColumns, v); }
};

double elevation_of(const Eigen::Vector3f& p) {
  return std::atan2(double(p.z()), std::hypot(double(p.x()), double(p.y())));
}

SphericalImage spherical_image(const std::vector<Eigen::Vector3f>& points) {
  SphericalImage image;
  std::vector<double> elevations;
  for (const Eigen::Vector3f& p : points) elevations.push_back(elevation_of(p));
  if (elevations.empty()) return image;
  // The sensor's fan without the few stray points beyond it.
  std::sort(elevations.begin(), elevations.end());
  const auto quantile = [&](double q) { return elevations[size_t(q * double(elevations.size() - 1))]; };
  image.top = quantile(0.999);
  image.row_step = std::max(1e-6, (image.top - quantile(0.001)) / (kRows - 1));
  for (const Eigen::Vector3f& p : points) {
    const double row = std::floor(image.row(elevation_of(p)) + 0.5);
    const double column = std::floor(image.column(std::atan2(double(p.y()), double(p.x()))) + 0.5);
    if (row < 0 || row >= kRows) continue;
    float& range = image.range((int(column) + kColumns) % kColumns, int(row));
    const float own = p.norm();
    if (own > 0 && (range == 0 || own < range)) range = own;
  }
  return image;
}

/// The first row from `from` on in steps of `step` that has a range in the column or beside it, at most kRowReach from
/// `row`; -1 where there is none.
int filled_row(const SphericalImage& image, int column, double row, int from, int step, float& range) {
  for (int v = from; v >= 0 && v < kRows && std::abs(v - row) <= kRowReach; v += step)
    for (const int u : {column, column - 1, column + 1})
      if ((range = image.at(u, v)) > 0) return v;
  return -1;
}

float range_along(const SphericalImage& image, const Eigen::Vector3d& direction) {
  const double row = image.row(std::atan2(direction.z(), std::hypot(direction.x(), direction.y())));
  if (!(row > -0.5 && row < kRows - 0.5)) return 0;
  const int column = int(std::floor(image.column(std::atan2(direction.y(), direction.x())) + 0.5));
  float above = 0, below = 0;
  const int upper = filled_row(image, column, row, int(std::floor(row)), -1, above);
  const int lower = filled_row(image, column, row, int(std::floor(row)) + 1, 1, below);
  if (upper >= 0 && lower >= 0) {
    if (std::max(above, below) > kLargestRatio * std::min(above, below)) return 0;
    const double share = (row - upper) / (lower - upper);
    return float(1 / ((1 - share) / above + share / below));
  }
  // At the edge of the fan or of a surface only a row that the ray all but meets counts.
  if (upper >= 0 && row - upper < 0.5) return above;
  if (lower >= 0 && lower - row < 0.5) return below;
  return 0;
}

}  // namespace

std::vector<Eigen::Vector3f> decode_scan(std::span<const uint8_t> bytes, const std::string& where) {
  constexpr size_t kPointBytes = 4 * sizeof(float);
  if (bytes.empty() || bytes.size() % kPointBytes != 0)
    throw ImageError("truncated", describe_mismatch(where, "scan", "a whole number of 16-byte points",
                                                    std::to_string(bytes.size()) + " bytes"));
  std::vector<Eigen::Vector3f> points;
  points.reserve(bytes.size() / kPointBytes);
  for (size_t at = 0; at < bytes.size(); at += kPointBytes) {
    Eigen::Vector3f p;
    std::memcpy(p.data(), bytes.data() + at, 3 * sizeof(float));
    if (p.allFinite() && p.norm() < 1e4f) points.push_back(p);
  }
  return points;
}

PinholeCamera scan_face_camera() {
  constexpr double kHalf = kFaceSize / 2.0;
  return {kHalf, kHalf, kHalf - 0.5, kHalf - 0.5, kFaceSize, kFaceSize};
}

Eigen::Isometry3d T_scan_face(int face) {
  const double azimuth = face * std::numbers::pi / 2;
  const double c = std::round(std::cos(azimuth)), s = std::round(std::sin(azimuth));
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear().col(0) = Eigen::Vector3d(s, -c, 0);
  T.linear().col(1) = Eigen::Vector3d(0, 0, -1);
  T.linear().col(2) = Eigen::Vector3d(c, s, 0);
  return T;
}

DepthImage depth_of_scan(const std::vector<Eigen::Vector3f>& points, int face, const PinholeCamera& camera) {
  const SphericalImage image = spherical_image(points);
  const Eigen::Matrix3d R = T_scan_face(face).linear();
  DepthImage depth(camera.width, camera.height);
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u) {
      const Eigen::Vector3d ray = camera.ray(u, v);
      const float range = range_along(image, R * ray);
      if (range > 0) depth(u, v) = float(double(range) / ray.norm());
    }
  return depth;
}

}  // namespace felt
