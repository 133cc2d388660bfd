#include "mapping/store/size_estimate.h"

#include <catch2/catch.hpp>

#include "mapping/fusion/tsdf_integrator.h"

namespace felt {
namespace {

/// A wall two metres in front of the camera, which looks around by `yaw_rad`.
Frame wall(double yaw_rad) {
  Frame frame;
  frame.camera = {525, 525, 319.5, 239.5, 640, 480};
  frame.depth_m = DepthImage(640, 480, 2.0f);
  frame.T_world_camera = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitY());
  return frame;
}

}  // namespace

TEST_CASE("the estimated number of blocks is near the number that fusion allocates") {
  for (const double voxel_size_m : {0.05, 0.02, 0.01, 0.005}) {
    INFO("voxel size " << voxel_size_m);
    const double truncation_m = 4 * voxel_size_m;
    Map map(voxel_size_m, truncation_m);
    SurfaceEstimate surface(0.05);
    IntegrationConfig config;
    IntegrationScratch scratch;
    for (const double yaw_rad : {0.0, 0.7, 1.9}) {
      integrate(map, wall(yaw_rad), config, scratch);
      surface.add(wall(yaw_rad), config.min_depth_m, config.max_depth_m);
    }
    const double estimated = blocks_near_surface(surface.area_m2(), {voxel_size_m, truncation_m, true});
    const auto allocated = double(map.store.size());
    CHECK(estimated < 2 * allocated);
    CHECK(estimated > 0.5 * allocated);
  }
}

TEST_CASE("the surface seen twice counts once") {
  SurfaceEstimate surface(0.05);
  surface.add(wall(0.1), 0.1, 4);
  const double once = surface.area_m2();
  surface.add(wall(0.1), 0.1, 4);
  CHECK(surface.area_m2() == once);
  CHECK(once == Approx(2 * 640.0 / 525 * 2 * 480 / 525).epsilon(0.4));
}

TEST_CASE("pixels outside the depth range foretell nothing") {
  SurfaceEstimate surface(0.05);
  surface.add(wall(0), 0.1, 1.9);
  surface.add(wall(0), 2.1, 4);
  CHECK(surface.area_m2() == 0);
}

TEST_CASE("the largest area in view is more than a wall at the largest depth shows") {
  const Frame frame = wall(0);
  SurfaceEstimate surface(0.05);
  surface.add(frame, 0.1, 2);
  CHECK(largest_area_in_view_m2(frame.camera, 2) > surface.area_m2());
}

}  // namespace felt
