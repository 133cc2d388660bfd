#include "io/sequence/pose_list.h"

#include <catch2/catch.hpp>
#include <fstream>

#include "core/error.h"
#include "tests/support/data.h"

using namespace felt;
using Catch::Matchers::Contains;

TEST_CASE("a pose is read from a matrix or a quaternion, with or without a stamp") {
  const Eigen::Isometry3d T = parse_pose("0 -1 0 4, 1 0 0 5, 0 0 1 6, 0 0 0 1", "here");
  CHECK(T.translation() == Eigen::Vector3d(4, 5, 6));
  CHECK((T.linear() * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm() < 1e-12);
  const double h = std::sqrt(0.5);
  const std::string quaternion = "4 5 6 0 0 " + std::to_string(h) + " " + std::to_string(h);
  CHECK(parse_pose(quaternion, "here").isApprox(T, 1e-6));
  CHECK(parse_pose("1305031.5 " + quaternion, "here").isApprox(T, 1e-6));
  CHECK(parse_pose("7 0 -1 0 4 1 0 0 5 0 0 1 6", "here").isApprox(T));
}

TEST_CASE("what is no pose is refused with its place") {
  CHECK_THROWS_WITH(parse_pose("1 2 3", "--pose"), Contains("--pose") && Contains("found 3"));
  CHECK_THROWS_WITH(parse_pose("1 2 3 0 0 0 2", "--pose"), Contains("length 1"));
  CHECK_THROWS_WITH(parse_pose("1 2 x 0 0 0 1", "--pose"), Contains("numbers") && Contains("x"));
  CHECK_THROWS_AS(parse_pose("2 0 0 0 0 1 0 0 0 0 1 0", "--pose"), FormatError);
  CHECK_THROWS_AS(parse_pose("1 0 0 nan 0 1 0 0 0 0 1 0", "--pose"), FormatError);
  const test::TemporaryDirectory folder;
  std::ofstream(folder.path() / "t.txt") << "# x y z\n\n1 2 3 0 0 0 1\n1 2 3 0 0 0\n";
  CHECK_THROWS_WITH(read_poses(folder.path() / "t.txt"), Contains("t.txt:4"));
  CHECK_THROWS_AS(read_poses(folder.path() / "absent.txt"), IoError);
  std::ofstream(folder.path() / "e.txt") << "# nothing\n";
  CHECK_THROWS_AS(read_poses(folder.path() / "e.txt"), FormatError);
}
