#include <catch2/catch.hpp>

#include <limits>
#include <optional>

#include "mapping/map.h"
#include "tests/support/analytic_map.h"

namespace felt::test {

TEST_CASE("a distance between voxel centres is that of the plane they were filled from") {
  Map map(0.1, 10);
  const auto plane = [](const Eigen::Vector3d& p) { return 0.3 * p.x() - 0.5 * p.y() + 0.8 * p.z() + 0.05; };
  fill_map(map, {-10, -10, -10}, {10, 10, 10}, plane);
  for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.137, -0.42, 0.2501), Eigen::Vector3d(-0.85, 0.8, -0.001),
                                   Eigen::Vector3d(0.3, 0.3, 0.3), Eigen::Vector3d(-0.9999, -0.55, 0.79)}) {
    const std::optional<double> distance = sample_tsdf(map, p);
    REQUIRE(distance);
    CHECK(*distance == Approx(plane(p)).margin(1e-6));
  }
}

TEST_CASE("a distance needs the voxels that have a share in it, and no others") {
  Map map(0.1, 10);
  set_voxel(map, {7, 0, 0}, 0.2f);
  set_voxel(map, {8, 0, 0}, 0.3f);  // of the next block
  CHECK(*sample_tsdf(map, {0.725, 0, 0}) == Approx(0.225));
  CHECK(*sample_tsdf(map, {0.725, 1e-6, -1e-6}) == Approx(0.225));  // off the edge by less than anybody means
  CHECK_FALSE(sample_tsdf(map, {0.725, 0.01, 0}));
  CHECK(*sample_tsdf(map, {0.8, 0, 0}) == Approx(0.3));
  CHECK_FALSE(sample_tsdf(map, {0.825, 0, 0}));
  set_voxel(map, {9, 0, 0}, 0.4f, 0);  // not observed
  CHECK_FALSE(sample_tsdf(map, {0.825, 0, 0}));
}

TEST_CASE("a point that is no place of a map has no distance") {
  Map map(0.1, 10);
  set_voxel(map, {0, 0, 0}, 0.2f);
  CHECK_FALSE(sample_tsdf(map, {1e12, 0, 0}));
  CHECK_FALSE(sample_tsdf(map, {0, std::numeric_limits<double>::quiet_NaN(), 0}));
}

}  // namespace felt::test
