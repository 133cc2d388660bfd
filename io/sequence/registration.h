#pragma once

#include <Eigen/Core>

#include "core/camera.h"
#include "core/image.h"
#include "io/sequence/undistortion.h"

namespace felt {

/// `image` of `camera` on the pixel grid of `depth_camera`: each pixel takes the nearest one that the same ray meets,
/// `outside` where there is none. With an identity `T_image_depth` depth plays no part; otherwise pixels without depth
/// take `outside`, and so do those that the image's camera sees another surface before. `distortion` of the image's
/// lens.
template <typename Pixel>
Image<Pixel> registered_to_depth(const Image<Pixel>& image, const PinholeCamera& camera, const DepthImage& depth_m,
                                 const PinholeCamera& depth_camera, const Eigen::Matrix4d& T_image_depth, Pixel outside,
                                 const Distortion& distortion = {});

}  // namespace felt
