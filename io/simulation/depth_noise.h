#pragma once

#include <cstdint>

#include "io/simulation/render_scene.h"

namespace felt {

/// A structured-light depth camera. Axial and lateral noise after Nguyen, Izadi and Lovell, "Modeling Kinect Sensor
/// Noise for Improved 3D Reconstruction and Tracking" (3DIMPVT 2012); quantisation in disparity as in such sensors.
struct DepthNoise {
  double axial_scale = 1;                     ///< times sigma_z of the model; 0: none
  double lateral_scale = 1;                   ///< times sigma_L of the model; 0: none
  double disparity_step_px = 0.125;           ///< 0: no quantisation
  double baseline_m = 0.075;                  ///< of the projector, for the disparity
  double min_depth_m = 0.4, max_depth_m = 8;  ///< nothing is measured outside
  double max_incidence_deg = 82;              ///< surfaces seen at a more grazing angle are not measured
  double edge_dropout = 0.5;                  ///< share of pixels lost beside a depth discontinuity
  double random_dropout = 0.002;              ///< share of pixels lost anywhere
};

/// Standard deviation along the optical axis, metres, of a surface at `depth_m` seen at `incidence_rad` from its
/// normal: 0.0012 + 0.0019 (z - 0.4)^2, and beyond 60 degrees + 0.0001 / sqrt(z) * theta^2 / (pi/2 - theta)^2.
double axial_sigma_m(double depth_m, double incidence_rad);
/// Standard deviation across the image, pixels: 0.8 + 0.035 theta / (pi/2 - theta).
double lateral_sigma_px(double incidence_rad);

/// The depth image that the sensor gives of an exact view; 0 where it measures nothing. A pure function of the
/// arguments: the same for any number of threads.
DepthImage add_depth_noise(const SceneView& view, const PinholeCamera& camera, const DepthNoise& noise, uint64_t seed,
                           int64_t frame);

}  // namespace felt
