#pragma once

#include <cstddef>

#include "core/image.h"
#include "mapping/store/block_store.h"
#include "mapping/touch/voxel_beliefs.h"

namespace felt {

/// Class id of the strongest class of each pixel's voxel; the id kNoLabel where there is no surface, or neither
/// evidence nor a touch. Images of this header are computed in parallel.
LabelImage class_image(const Map& map, const VoxelBeliefs& beliefs, const Image<VoxelRef>& voxels);

/// Entropy of the class probabilities, nats; NaN where there is no surface.
Image<float> entropy_image(const VoxelBeliefs& beliefs, const Image<VoxelRef>& voxels);

/// Mean and standard deviation of the next reading of a property, in its unit; NaN where there is no surface, no class
/// with a prior, or no such moment.
struct PropertyImages {
  Image<float> mean, sd;
};
PropertyImages property_images(const VoxelBeliefs& beliefs, const Image<VoxelRef>& voxels, int property);

}  // namespace felt
