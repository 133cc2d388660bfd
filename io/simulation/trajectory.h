#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "io/simulation/scene.h"

namespace felt {

/// T_world_camera per frame; OpenCV axes (x right, y down, z forward).
using Trajectory = std::vector<Eigen::Isometry3d>;

/// Upright camera (world z up) at `position_m` that looks at `target_m`, which is not straight above or below.
Eigen::Isometry3d look_at(const Eigen::Vector3d& position_m, const Eigen::Vector3d& target_m);

/// Evenly spaced along a Catmull-Rom curve through the way-points, from the first to the last; what is looked at moves
/// likewise. At least one way-point; `frames` >= 1.
Trajectory walk_through(std::span<const WayPoint> path, int frames);
/// Around a vertical axis through `center_m` at a horizontal distance and height above it, looking at it; `turn_rad` of
/// the circle, its end not repeated.
Trajectory orbit(const Eigen::Vector3d& center_m, double radius_m, double height_m, double turn_rad, int frames);
/// Turning on the spot by `turn_rad` from `yaw_rad` (0: along world x), tilted by `pitch_rad` (positive: up).
Trajectory sweep(const Eigen::Vector3d& position_m, double yaw_rad, double turn_rad, double pitch_rad, int frames);
/// The scene's own path.
Trajectory standard_trajectory(const Scene& scene, int frames);

/// Smallest signed distance from a camera centre of the trajectory to the scene, metres.
double clearance_m(const Scene& scene, const Trajectory& trajectory);

}  // namespace felt
