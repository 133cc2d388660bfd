#include "io/sequence/recorded_pose.h"

#include "core/error.h"
#include "core/pose.h"
#include "io/sequence/skip_reasons.h"
#include "io/sequence/trajectory_file.h"

namespace felt {
namespace fs = std::filesystem;

std::variant<Eigen::Isometry3d, PoseProblem> recorded_pose(const FrameRecord& frame) {
  Eigen::Matrix4d recorded;
  std::string where = "trajectory";
  if (frame.pose) {
    recorded = *frame.pose;
  } else if (std::error_code fault; frame.pose_file.empty() || !fs::exists(frame.pose_file, fault)) {
    return PoseProblem{kMissingPose, "no pose recorded"};
  } else {
    where = frame.pose_file.string();
    try {
      recorded = read_pose_file(frame.pose_file);
    } catch (const Error& problem) {
      return PoseProblem{kUnreadablePose, problem.what()};
    }
  }
  Eigen::Isometry3d T;
  switch (rigid_pose(recorded, T)) {
    case PoseFault::not_finite:
      return PoseProblem{kNonFinitePose, where};
    case PoseFault::not_rigid:
      return PoseProblem{kNonRigidPose, where};
    case PoseFault::none:
      break;
  }
  return T;
}

Eigen::Isometry3d camera_pose(const Eigen::Isometry3d& recorded, const PoseConvention& convention,
                              const Eigen::Isometry3d& T_body_camera) {
  Eigen::Isometry3d T = convention.world_to_camera ? recorded.inverse() : recorded;
  T = T * T_body_camera;
  if (convention.opengl_axes) T.linear() = T.linear() * Eigen::Vector3d(1, -1, -1).asDiagonal();
  return T;
}

}  // namespace felt
