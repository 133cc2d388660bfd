#pragma once

#include "core/camera.h"
#include "core/image.h"
#include "io/simulation/scene.h"

namespace felt {

/// What an ideal camera sees, exact. All images have the camera's size; pixels that hit nothing hold 0.
struct SceneView {
  DepthImage depth_m;          ///< along the optical axis, through pixel centres
  Image<float> incidence_cos;  ///< cosine of the angle between the ray and the surface normal, in [0, 1]
  ColorImage color;            ///< Lambert shading of the procedural texture; empty unless asked
  LabelImage semantics, materials;
  Image<uint16_t> instances;
};

struct SceneHit {
  double depth_m = 0;                                ///< along `direction`: the hit is at origin + depth * direction
  int primitive = -1;                                ///< -1: nothing hit
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< outward, world frame
};

/// First surface that a ray from free space meets at a positive distance. `direction` need not be normalised.
SceneHit cast_ray(const Scene& scene, const Eigen::Vector3d& origin_m, const Eigen::Vector3d& direction);

/// Renders a view on all cores. A pixel's values depend on nothing but scene, camera and pose.
SceneView render_view(const Scene& scene, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                      bool with_color = true);

}  // namespace felt
