#pragma once

#include <Eigen/Core>

#include "io/simulation/scene.h"

namespace felt {

struct ShapeHit {
  double t = HUGE_VAL;                               ///< the ray parameter; infinite: missed
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< outward, in the shape's frame
};

/// First crossing from outside at t > 0 of the ray o + t d, both in the shape's frame.
ShapeHit cast_at_shape(ShapeKind shape, const Eigen::Vector3d& half_size_m, const Eigen::Vector3d& o,
                       const Eigen::Vector3d& d);

/// Rays of one piece of an image row, cast at one shape at a time.
struct RaySpan {
  static constexpr int kWidth = 16;
  double x[kWidth];     ///< x / z of each ray's direction (x/z, y/z, 1), camera frame
  double y = 0;         ///< y / z, shared by the row
  double t[kWidth];     ///< nearest hit so far, metres along the optical axis
  int nearest[kWidth];  ///< number of the shape it belongs to; -1: none
};

/// Casts the span's rays at shape number `number`: `R_shape_camera`, and the camera's centre `o` in the shape's frame.
/// Equal distances go to the smaller number. Bit for bit what `cast_at_shape` gives for each ray.
void cast_span_at_shape(const Primitive& shape, const Eigen::Matrix3d& R_shape_camera, const Eigen::Vector3d& o,
                        int number, RaySpan& span);

}  // namespace felt
