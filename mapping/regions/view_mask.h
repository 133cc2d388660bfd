#pragma once

#include <Eigen/Geometry>
#include <cstdint>

#include "core/camera.h"
#include "core/image.h"

namespace felt {

/// An image mask with the camera that took it: non-zero pixels belong to the region.
struct ViewMask {
  Image<uint8_t> mask;
  PinholeCamera camera;
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
};

/// Tells views apart: a hash of the mask, its camera and its pose; never 0.
uint64_t digest(const ViewMask& view);

}  // namespace felt
