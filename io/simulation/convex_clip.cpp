#include "io/simulation/convex_clip.h"

#include <Eigen/Geometry>

namespace felt {
namespace {

using Eigen::Vector3d;

/// Without area there is nothing to see; slivers come from rounding.
bool has_area(const Polygon& polygon) {
  Vector3d twice_area = Vector3d::Zero();
  for (size_t i = 2; i < polygon.size(); ++i)
    twice_area += (polygon[i - 1] - polygon[0]).cross(polygon[i] - polygon[0]);
  return twice_area.norm() > 1e-12;
}

HalfSpace flipped(const HalfSpace& h) { return {-h.normal, -h.offset}; }

}  // namespace

Polygon clipped(const Polygon& polygon, const HalfSpace& half_space) {
  // Sutherland and Hodgman 1974, one plane; corners within the slack count as inside.
  Polygon kept;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vector3d &a = polygon[i], &b = polygon[(i + 1) % polygon.size()];
    const double da = half_space.signed_distance(a), db = half_space.signed_distance(b);
    const bool a_inside = da <= kPlanarSlack_m, b_inside = db <= kPlanarSlack_m;
    if (a_inside) kept.push_back(a);
    const bool crosses = a_inside != b_inside && std::abs(da) > kPlanarSlack_m && std::abs(db) > kPlanarSlack_m;
    if (crosses) kept.push_back(a + da / (da - db) * (b - a));
  }
  return has_area(kept) ? kept : Polygon();
}

std::vector<Polygon> subtracted(const Polygon& polygon, const std::vector<HalfSpace>& convex) {
  Polygon inside = polygon;
  for (const HalfSpace& h : convex)
    if (inside = clipped(inside, h); inside.empty()) return {polygon};
  std::vector<Polygon> pieces;
  inside = polygon;
  for (const HalfSpace& h : convex) {
    if (Polygon outside = clipped(inside, flipped(h)); !outside.empty()) {
      // A face in the plane itself is inside of both halves: it belongs to the convex.
      bool in_plane = true;
      for (const Vector3d& p : outside) in_plane &= std::abs(h.signed_distance(p)) <= kPlanarSlack_m;
      if (!in_plane) pieces.push_back(std::move(outside));
    }
    inside = clipped(inside, h);
  }
  return pieces;
}

}  // namespace felt
