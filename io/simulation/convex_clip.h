#pragma once

#include <Eigen/Core>
#include <vector>

namespace felt {

/// The points with normal . x <= offset; `normal` has length 1.
struct HalfSpace {
  Eigen::Vector3d normal;
  double offset = 0;
  double signed_distance(const Eigen::Vector3d& p) const { return normal.dot(p) - offset; }
};

/// Convex and planar, corners in order; fewer than three corners: empty.
using Polygon = std::vector<Eigen::Vector3d>;

/// Points this near to a plane (metres) lie in it.
inline constexpr double kPlanarSlack_m = 1e-9;

/// The part of a polygon inside a half-space, its boundary included.
Polygon clipped(const Polygon& polygon, const HalfSpace& half_space);

/// What is left of a polygon outside of the intersection of half-spaces, as convex pieces with the polygon's
/// orientation; the polygon itself where they do not meet.
std::vector<Polygon> subtracted(const Polygon& polygon, const std::vector<HalfSpace>& convex);

}  // namespace felt
