#include "io/simulation/depth_noise.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/simulation/random.h"

namespace felt {
namespace {

constexpr double kHalfPi = std::numbers::pi / 2;
// Random streams: one a use, so that changing one kind of noise leaves the others as they were.
enum Stream : uint64_t { kAxial = 1, kLateralU, kLateralV, kDropout, kEdge };

/// A neighbour's depth differs by more than a slanted surface explains: 5 % of the depth.
bool beside_edge(const DepthImage& depth, int u, int v) {
  const float z = depth(u, v), limit = 0.05f * z;
  for (const auto& [du, dv] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
    const int x = std::clamp(u + du, 0, depth.width() - 1), y = std::clamp(v + dv, 0, depth.height() - 1);
    if (std::abs(depth(x, y) - z) > limit) return true;
  }
  return false;
}

}  // namespace

double axial_sigma_m(double depth_m, double incidence_rad) {
  const double d = depth_m - 0.4, sigma = 0.0012 + 0.0019 * d * d;
  if (incidence_rad <= std::numbers::pi / 3) return sigma;
  const double left = std::max(kHalfPi - incidence_rad, 1e-2);
  return sigma + 0.0001 / std::sqrt(depth_m) * incidence_rad * incidence_rad / (left * left);
}

double lateral_sigma_px(double incidence_rad) {
  return 0.8 + 0.035 * incidence_rad / std::max(kHalfPi - incidence_rad, 1e-2);
}

DepthImage add_depth_noise(const SceneView& view, const PinholeCamera& camera, const DepthNoise& noise, uint64_t seed,
                           int64_t frame) {
  const int w = view.depth_m.width(), h = view.depth_m.height();
  DepthImage measured(w, h);
  const double min_cos = std::cos(noise.max_incidence_deg * std::numbers::pi / 180);
  const auto measure = [&](int u, int v) -> double {
    const uint64_t pixel = uint64_t(v) * w + u;
    const auto bits = [&](Stream stream) { return random_bits(seed, stream, uint64_t(frame), pixel); };
    if (view.depth_m(u, v) <= 0) return 0;
    if (noise.random_dropout > 0 && uniform01(bits(kDropout)) < noise.random_dropout) return 0;
    if (noise.edge_dropout > 0 && beside_edge(view.depth_m, u, v) && uniform01(bits(kEdge)) < noise.edge_dropout)
      return 0;
    int from_u = u, from_v = v;
    if (noise.lateral_scale > 0) {
      const double sigma = noise.lateral_scale * lateral_sigma_px(std::acos(std::min(1.0f, view.incidence_cos(u, v))));
      from_u = std::clamp(u + int(std::lround(sigma * standard_normal(bits(kLateralU)))), 0, w - 1);
      from_v = std::clamp(v + int(std::lround(sigma * standard_normal(bits(kLateralV)))), 0, h - 1);
    }
    double z = view.depth_m(from_u, from_v);
    const double cosine = view.incidence_cos(from_u, from_v);
    if (z < noise.min_depth_m || z > noise.max_depth_m || cosine < min_cos) return 0;
    if (noise.axial_scale > 0)
      z += noise.axial_scale * axial_sigma_m(z, std::acos(std::min(1.0, cosine))) * standard_normal(bits(kAxial));
    if (noise.disparity_step_px > 0 && z > 0) {
      const double focal_baseline = camera.fx * noise.baseline_m, step = noise.disparity_step_px;
      const double disparity = std::round(focal_baseline / z / step) * step;
      z = disparity > 0 ? focal_baseline / disparity : 0;
    }
    return std::max(z, 0.0);
  };
  tbb::parallel_for(tbb::blocked_range<int>(0, h), [&](const tbb::blocked_range<int>& rows) {
    for (int v = rows.begin(); v != rows.end(); ++v)
      for (int u = 0; u < w; ++u) measured(u, v) = float(measure(u, v));
  });
  return measured;
}

}  // namespace felt
