#pragma once

#include <cstddef>
#include <vector>

#include "core/image.h"
#include "mapping/map.h"
#include "mapping/render.h"

namespace felt {

/// Expected class probabilities of a voxel by slot: Dirichlet with one count a class as the prior, plus what was seen.
std::vector<double> class_probability(const Map& map, const VoxelRef& voxel);

/// Class id of the strongest class of each pixel's voxel (the lower slot where two are equal); the id 0xffff where
/// there is no surface or no evidence.
LabelImage class_image(const Map& map, const Image<VoxelRef>& voxels);

/// Entropy of the class probabilities, nats; 0 where there is no surface.
Image<float> entropy_image(const Map& map, const Image<VoxelRef>& voxels);

}  // namespace felt
