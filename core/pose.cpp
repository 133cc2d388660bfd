#include "core/pose.h"

#include <Eigen/SVD>

namespace felt {

PoseFault rigid_pose(const Eigen::Matrix4d& recorded, Eigen::Isometry3d& T, double tolerance) {
  if (!recorded.allFinite()) return PoseFault::not_finite;
  const Eigen::Matrix3d R = recorded.topLeftCorner<3, 3>();
  const Eigen::RowVector4d last(0, 0, 0, 1);
  const double defect = (R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (defect > tolerance || R.determinant() <= 0 || (recorded.row(3) - last).cwiseAbs().maxCoeff() > 1e-6)
    return PoseFault::not_rigid;
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  T = Eigen::Isometry3d::Identity();
  T.linear() = svd.matrixU() * svd.matrixV().transpose();
  T.translation() = recorded.topRightCorner<3, 1>();
  return PoseFault::none;
}

}  // namespace felt
