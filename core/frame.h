#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>

#include "core/camera.h"
#include "core/image.h"

namespace felt {

/// One recorded view, decoded. Colour, labels, probabilities and instances are empty where the sequence has none;
/// where present they have the depth image's size and pixel grid (readers register and resize).
struct Frame {
  int64_t index = 0;     ///< frame number in the sequence (not the position in a --frames selection)
  double stamp_s = 0;    ///< recorded time, or the index where none is recorded
  PinholeCamera camera;  ///< of the depth image
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  DepthImage depth_m;
  ColorImage color;
  LabelImage labels;
  ProbabilityImage probabilities;
  Image<uint16_t> instances;
};

}  // namespace felt
