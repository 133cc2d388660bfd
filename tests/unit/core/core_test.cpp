#include <catch2/catch.hpp>
#include <limits>

#include "core/block.h"
#include "core/camera.h"
#include "core/class_table.h"
#include "core/error.h"
#include "core/pose.h"

using namespace felt;

TEST_CASE("block arithmetic floors for negative voxels") {
  CHECK(block_of_voxel({-1, -8, -9}) == BlockCoord{-1, -1, -2});
  CHECK(offset_in_block({-1, 0, 9}) == voxel_offset(7, 0, 1));
  for (int i = 0; i < kBlockVoxels; ++i) {
    const Index3 v = voxel_of_offset(i);
    REQUIRE(voxel_offset(v.x, v.y, v.z) == i);
    const Index3 far = voxel_at({-1, 0, 2}, i);
    REQUIRE(far == Index3{v.x - 8, v.y, v.z + 16});
    REQUIRE(block_of_voxel(far) == BlockCoord{-1, 0, 2});
    REQUIRE(offset_in_block(far) == i);
  }
}

TEST_CASE("a resized camera sees the same rays at the image's edges") {
  const PinholeCamera camera{585, 580, 320, 240, 640, 480};
  const PinholeCamera half = resized(camera, 320, 240);
  CHECK(half.ray(-0.5, -0.5).isApprox(camera.ray(-0.5, -0.5), 1e-12));
  CHECK(half.ray(319.5, 239.5).isApprox(camera.ray(639.5, 479.5), 1e-12));
}

TEST_CASE("recorded poses are made rigid, and what is no pose is told apart") {
  Eigen::Matrix4d M = Eigen::Matrix4d::Identity();
  M.topLeftCorner<3, 3>() = Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized()).matrix() * 0.9999;
  M.topRightCorner<3, 1>() << 1, 2, 3;
  Eigen::Isometry3d T;
  REQUIRE(rigid_pose(M, T) == PoseFault::none);
  CHECK((T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-12);
  CHECK(T.translation() == Eigen::Vector3d(1, 2, 3));
  CHECK(rigid_pose(M * 2, T) == PoseFault::not_rigid);
  CHECK(rigid_pose(Eigen::Matrix4d::Zero(), T) == PoseFault::not_rigid);
  Eigen::Matrix4d mirrored = M;
  mirrored.col(0) *= -1;
  CHECK(rigid_pose(mirrored, T) == PoseFault::not_rigid);
  M(0, 3) = -std::numeric_limits<double>::infinity();
  CHECK(rigid_pose(M, T) == PoseFault::not_finite);
}

TEST_CASE("a class table gives slots to classes that are not ignored and names every duplicate") {
  const ClassTable table({{0, "none", {}, true}, {7, "ice", {}, false}, {3, "snow", {}, false}});
  CHECK(table.size() == 2);
  CHECK(table.slot_of_id(7) == 0);
  CHECK(table.slot_of_id(3) == 1);
  CHECK(table.slot_of_id(0) == ClassTable::kNoSlot);
  CHECK(table.known(0));
  CHECK_FALSE(table.known(5));
  CHECK(table.slot_of_id(60000) == ClassTable::kNoSlot);
  CHECK(*table.slot_of_name("snow") == 1);
  try {
    ClassTable({{1, "ice", {}, false}, {1, "snow", {}, false}, {2, "ice", {}, false}});
    FAIL("duplicates were accepted");
  } catch (const ConfigError& e) {
    CHECK(std::string(e.what()).find("id 1") != std::string::npos);
    CHECK(std::string(e.what()).find("'ice'") != std::string::npos);
  }
}

TEST_CASE("classes without a prior of their own share eight counts where they are more than eight") {
  const auto table_of = [](int k, std::optional<double> prior) {
    std::vector<ClassInfo> rows{{0, "none", {}, true}};
    for (int i = 1; i <= k; ++i) rows.push_back({uint16_t(i), "class " + std::to_string(i), {}, false, prior});
    return ClassTable(rows);
  };
  CHECK(table_of(3, {}).prior(2) == 1);
  CHECK(table_of(8, {}).prior(7) == 1);
  CHECK(table_of(16, {}).prior(0) == 0.5);
  CHECK(table_of(16, {}).prior_total() == 8);
  CHECK(table_of(16, 2.0).prior(15) == 2);
  // Given or by default: the same belief.
  CHECK(table_of(16, {}) == table_of(16, 0.5));
  CHECK_FALSE(table_of(16, {}) == table_of(16, 1.0));
  std::vector<ClassInfo> rows = table_of(16, {}).classes();
  rows[4].prior = 3;
  const ClassTable mixed(rows);
  CHECK_FALSE(mixed.even_prior());
  CHECK(mixed.prior(3) == 3);
  CHECK(mixed.prior(4) == 0.5);
  CHECK_THROWS_AS(table_of(3, 0.0), ConfigError);
}
