#pragma once

#include <Eigen/Core>

#include "io/simulation/scene.h"

namespace felt {

/// Colour of a texture at a point of the shape's frame, linear light in [0, 1]; `seed` varies it from thing to thing.
Eigen::Vector3f texture_color(const Texture& texture, const Eigen::Vector3d& p_shape, const Eigen::Vector3d& n_shape,
                              uint64_t seed);

/// sRGB byte of a linear value, and back.
uint8_t srgb_byte(float linear);
float linear_value(uint8_t srgb);

}  // namespace felt
