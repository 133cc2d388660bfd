#pragma once

#include <Eigen/Geometry>
#include <string>
#include <variant>

#include "io/sequence/sequence_listing.h"

namespace felt {

/// Why a frame has no usable pose: a reason as counted in reports ("missing pose", "unreadable pose", "non-finite
/// pose", "non-rigid pose") and where.
struct PoseProblem {
  std::string reason, detail;
};

/// The rigid transform nearest to the recorded matrix, before any convention is applied.
std::variant<Eigen::Isometry3d, PoseProblem> recorded_pose(const FrameRecord& frame);

/// Camera-to-world pose, OpenCV axes, of a recorded transform; `T_body_camera` where the recorded poses are those of a
/// body that carries the camera.
Eigen::Isometry3d camera_pose(const Eigen::Isometry3d& recorded, const PoseConvention& convention,
                              const Eigen::Isometry3d& T_body_camera = Eigen::Isometry3d::Identity());

}  // namespace felt
