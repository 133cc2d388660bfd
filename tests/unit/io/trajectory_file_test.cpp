#include "io/sequence/trajectory_file.h"

#include <catch2/catch.hpp>

using namespace felt;

namespace {

Eigen::Matrix4d turned(double radians, const Eigen::Vector3d& position) {
  Eigen::Matrix4d T = Eigen::Matrix4d::Identity();
  T.topLeftCorner<3, 3>() = Eigen::AngleAxisd(radians, Eigen::Vector3d(1, 2, 2).normalized()).toRotationMatrix();
  T.topRightCorner<3, 1>() = position;
  return T;
}

/// Poses at 10.00, 10.04 and 10.05 s, then a gap to 10.50 s.
const std::vector<double> kStamps = {10, 10.04, 10.05, 10.5};
std::vector<StampedPose> recorded() {
  return {{10, turned(0, {0, 0, 0}), 1},
          {10.04, turned(0.8, {4, 8, -4}), 2},
          {10.05, turned(0.9, {5, 9, -5}), 3},
          {10.5, turned(2, {9, 9, 9}), 4}};
}

}  // namespace

TEST_CASE("a pose between two stamps lies on the straight way and on the shortest turn, at constant speed") {
  const auto pose = pose_at_stamp(recorded(), kStamps, 10.01, 0.04);
  REQUIRE(pose);
  CHECK(pose->isApprox(turned(0.2, {1, 2, -1}), 1e-9));
  CHECK(pose_at_stamp(recorded(), kStamps, 10.03, 0.04)->isApprox(turned(0.6, {3, 6, -3}), 1e-9));
  // A turn of 350 degrees is one of 10 degrees the other way.
  const Eigen::Isometry3d a(turned(0, {0, 0, 0})), b(turned(350 * M_PI / 180, {0, 0, 0}));
  CHECK(interpolated_pose(a, b, 0.5).matrix().isApprox(turned(-5 * M_PI / 180, {0, 0, 0}), 1e-9));
}

TEST_CASE("a pose is interpolated only where both neighbours are near enough, else the nearest is taken as it is") {
  // 10.30 s: neighbours are 0.25 and 0.20 s away.
  CHECK_FALSE(pose_at_stamp(recorded(), kStamps, 10.3, 0.1));
  CHECK(pose_at_stamp(recorded(), kStamps, 10.3, 0.22)->isApprox(recorded()[3].matrix, 1e-12));
  CHECK(pose_at_stamp(recorded(), kStamps, 10.06, 0.02)->isApprox(recorded()[2].matrix, 1e-12));
  const auto between = pose_at_stamp(recorded(), kStamps, 10.3, 0.26);
  REQUIRE(between);
  CHECK(between->col(3).x() == Approx(5 + 4 * 0.25 / 0.45));
  // Before the first and after the last.
  CHECK(pose_at_stamp(recorded(), kStamps, 9.99, 0.02)->isApprox(recorded()[0].matrix, 1e-12));
  CHECK(pose_at_stamp(recorded(), kStamps, 10.51, 0.02)->isApprox(recorded()[3].matrix, 1e-12));
  CHECK_FALSE(pose_at_stamp(recorded(), kStamps, 9.9, 0.02));
  CHECK_FALSE(pose_at_stamp({}, {}, 1, 1e9));
}

TEST_CASE("a pose on a stamp is the recorded one, and one beside a pose that is none is not made up") {
  CHECK(*pose_at_stamp(recorded(), kStamps, 10.04, 0.02) == recorded()[1].matrix);
  std::vector<StampedPose> lost = recorded();
  lost[1].matrix.setConstant(-std::numeric_limits<double>::infinity());
  CHECK(pose_at_stamp(lost, kStamps, 10.01, 0.04)->isApprox(lost[0].matrix, 1e-12));
  CHECK_FALSE(pose_at_stamp(lost, kStamps, 10.039, 0.04)->allFinite());
}

TEST_CASE("stamps that break the order are as few as can be") {
  CHECK(out_of_order({1, 2, 9, 3, 4}) == std::vector<bool>{false, false, true, false, false});
  CHECK(out_of_order({5, 1, 2, 3}) == std::vector<bool>{true, false, false, false});
  CHECK(out_of_order({1, NAN, 2}) == std::vector<bool>{false, true, false});
  CHECK(out_of_order({}).empty());
}
