#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>

namespace felt {

/// Why a recorded 4x4 matrix is no pose.
enum class PoseFault { none, not_finite, not_rigid };

/// Rigid transform nearest to a recorded 4x4 matrix (rotation by SVD): recorded rotations are orthonormal to about 1e-4
/// only (7-Scenes: determinant 0.9998). `not_rigid` where the rotation part is farther than `tolerance` from
/// orthonormal (largest entry of R^T R - 1), mirrored, or the last row is not (0, 0, 0, 1).
PoseFault rigid_pose(const Eigen::Matrix4d& recorded, Eigen::Isometry3d& T, double tolerance = 0.02);

}  // namespace felt
