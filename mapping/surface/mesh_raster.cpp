#include "mapping/surface/mesh_raster.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace felt {
namespace {
using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kSamples = 2;  ///< a side
constexpr int kBandRows = 32;

struct Fragment {
  float depth = std::numeric_limits<float>::infinity();
  Vector3f color;
};

Vector3f rgb(const Rgba8& c) { return Vector3f(c.r, c.g, c.b); }

/// Colour of a vertex under a shading, in grey levels.
Vector3f shade(const TriangleMesh& mesh, uint32_t i, const Vector3f& normal_world, const Vector3f& normal_camera,
               Shading shading) {
  if (shading == Shading::normal) return (normal_world + Vector3f::Ones()) * 127.5f;
  const Vector3f towards_light = Vector3f(-0.4f, -0.65f, -0.65f).normalized();
  const float diffuse = std::max(0.0f, normal_camera.dot(towards_light));
  if (shading == Shading::clay || mesh.colors.empty()) return Vector3f(225, 222, 215) * (0.25f + 0.75f * diffuse);
  return rgb(mesh.colors[i]) * (0.8f + 0.2f * diffuse);
}

double percentile(std::vector<double>& values, double share) {
  const auto at = values.begin() + ptrdiff_t(share * double(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

class Raster {
public:
  Raster(const TriangleMesh& mesh, const RasterView& view, Shading shading)
      : mesh_(mesh), shading_(shading), width_(view.width * kSamples), height_(view.height * kSamples) {
    const double scale = kSamples / view.metres_per_pixel;
    rotation_ = view.T_camera_world.linear().cast<float>();
    screen_.resize(mesh.positions.size());
    tbb::parallel_for(size_t(0), screen_.size(), [&](size_t i) {
      const Vector3d p = view.T_camera_world * mesh.positions[i].cast<double>();
      screen_[i] = {float(p.x() * scale + 0.5 * width_), float(p.y() * scale + 0.5 * height_), float(p.z())};
    });
    sort_into_bands();
  }

  ColorImage draw(Rgba8 background) const {
    ColorImage image(width_ / kSamples, height_ / kSamples);
    tbb::parallel_for(size_t(0), bands_.size(), [&](size_t band) {
      const int first = int(band) * kBandRows, rows = std::min(kBandRows, height_ - first);
      std::vector<Fragment> fragments(size_t(rows) * width_);
      for (auto& f : fragments) f.color = rgb(background);
      for (const uint32_t t : bands_[band]) draw_triangle(mesh_.triangles[t], first, rows, fragments);
      for (int v = 0; v < rows / kSamples; ++v)
        for (int u = 0; u < image.width(); ++u) {
          Vector3f sum = Vector3f::Zero();
          for (int s = 0; s < kSamples * kSamples; ++s)
            sum += fragments[size_t(v * kSamples + s / kSamples) * width_ + u * kSamples + s % kSamples].color;
          const Vector3f mean = (sum / (kSamples * kSamples)).cwiseMin(255.0f) + Vector3f::Constant(0.5f);
          image(u, first / kSamples + v) = {uint8_t(mean.x()), uint8_t(mean.y()), uint8_t(mean.z()), 255};
        }
    });
    return image;
  }

private:
  /// Twice the area on the screen; negative: seen from behind (y points down, so front faces turn clockwise).
  float area(const Triangle& t) const {
    const Vector3f &a = screen_[t[0]], &b = screen_[t[1]], &c = screen_[t[2]];
    return (c.x() - a.x()) * (b.y() - a.y()) - (b.x() - a.x()) * (c.y() - a.y());
  }

  void sort_into_bands() {
    bands_.resize(size_t((height_ + kBandRows - 1) / kBandRows));
    for (uint32_t i = 0; i < mesh_.triangles.size(); ++i) {
      const Triangle& t = mesh_.triangles[i];
      if (!(area(t) > 0)) continue;
      const float low = std::min({screen_[t[0]].y(), screen_[t[1]].y(), screen_[t[2]].y()});
      const float high = std::max({screen_[t[0]].y(), screen_[t[1]].y(), screen_[t[2]].y()});
      if (!(high >= 0 && low < float(height_))) continue;
      const int first = int(std::max(low, 0.0f)) / kBandRows,
                last = int(std::min(high, float(height_ - 1))) / kBandRows;
      for (int band = first; band <= last; ++band) bands_[size_t(band)].push_back(i);
    }
  }

  Vector3f normal_of(const Triangle& t, int corner) const {
    if (!mesh_.normals.empty()) return mesh_.normals[t[corner]];
    const Vector3f a = mesh_.positions[t[0]];
    return (mesh_.positions[t[1]] - a).cross(mesh_.positions[t[2]] - a).normalized();
  }

  void draw_triangle(const Triangle& t, int first_row, int rows, std::vector<Fragment>& fragments) const {
    const Vector3f &a = screen_[t[0]], &b = screen_[t[1]], &c = screen_[t[2]];
    const float inverse = 1 / area(t);
    Vector3f colors[3];
    for (int i = 0; i < 3; ++i) {
      const Vector3f n = normal_of(t, i);
      colors[i] = shade(mesh_, t[i], n, rotation_ * n, shading_);
    }
    // Sample (u, v) is at (u + 0.5, v + 0.5).
    const auto low = [](float x, int limit) { return std::clamp(int(std::ceil(x - 0.5f)), 0, limit); };
    const int u0 = low(std::min({a.x(), b.x(), c.x()}), width_), u1 = low(std::max({a.x(), b.x(), c.x()}), width_);
    const int v0 = std::max(low(std::min({a.y(), b.y(), c.y()}), height_), first_row);
    const int v1 = std::min(low(std::max({a.y(), b.y(), c.y()}), height_), first_row + rows);
    for (int v = v0; v < v1; ++v)
      for (int u = u0; u < u1; ++u) {
        const float x = float(u) + 0.5f, y = float(v) + 0.5f;
        const auto weight = [&](const Vector3f& p, const Vector3f& q) {
          return ((q.x() - x) * (p.y() - y) - (p.x() - x) * (q.y() - y)) * inverse;
        };
        const float wa = weight(b, c), wb = weight(c, a), wc = 1 - wa - wb;
        if (wa < 0 || wb < 0 || wc < 0) continue;
        const float depth = wa * a.z() + wb * b.z() + wc * c.z();
        Fragment& fragment = fragments[size_t(v - first_row) * width_ + u];
        if (depth >= fragment.depth) continue;
        fragment = {depth, wa * colors[0] + wb * colors[1] + wc * colors[2]};
      }
  }

  const TriangleMesh& mesh_;
  Shading shading_;
  int width_, height_;  ///< in samples
  Eigen::Matrix3f rotation_;
  std::vector<Vector3f> screen_;
  std::vector<std::vector<uint32_t>> bands_;  ///< front-facing triangles that reach into each band, ascending
};

}  // namespace

ColorImage draw_mesh(const TriangleMesh& mesh, const RasterView& view, Shading shading, Rgba8 background) {
  return Raster(mesh, view, shading).draw(background);
}

RasterView overview(const TriangleMesh& mesh, const Vector3d& up, double azimuth_deg, double elevation_deg, int width,
                    int height) {
  // Axes of the ground: x is the world axis least along `up`, so that the azimuth means the same for every map.
  const Vector3d z = up.normalized();
  int least;
  z.cwiseAbs().minCoeff(&least);
  const Vector3d x = (Vector3d::Unit(least) - z * z[least]).normalized(), y = z.cross(x);
  const double azimuth = azimuth_deg * std::numbers::pi / 180, elevation = elevation_deg * std::numbers::pi / 180;
  const Vector3d away = std::cos(azimuth) * x + std::sin(azimuth) * y;  // from the mesh to the viewer, level
  const Vector3d forward = -(std::cos(elevation) * away + std::sin(elevation) * z);
  const Vector3d right = z.cross(away).normalized();
  Eigen::Matrix3d rotation;
  rotation << right, forward.cross(right), forward;
  RasterView view;
  view.width = width;
  view.height = height;
  view.T_camera_world.linear() = rotation.transpose();
  if (mesh.positions.empty()) return view;
  std::vector<double> across[2];
  for (const Vector3f& p : mesh.positions) {
    if (!p.allFinite()) continue;
    const Vector3d q = rotation.transpose() * p.cast<double>();
    across[0].push_back(q.x());
    across[1].push_back(q.y());
  }
  if (across[0].empty()) return view;
  double per_pixel = 1e-9;
  Vector3d middle = Vector3d::Zero();
  for (int i = 0; i < 2; ++i) {
    const double low = percentile(across[i], 0.01), high = percentile(across[i], 0.99);
    middle[i] = 0.5 * (low + high);
    per_pixel = std::max(per_pixel, 1.12 * (high - low) / (i == 0 ? width : height));
  }
  view.T_camera_world.translation() = -middle;
  view.metres_per_pixel = per_pixel;
  return view;
}

}  // namespace felt
