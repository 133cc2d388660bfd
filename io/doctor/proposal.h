#pragma once

#include "io/doctor/doctor.h"
#include "io/doctor/geometry.h"

namespace felt {

/// From the depth of the sampled frames as `reading` has it: voxels of three pixels at the median depth, but no finer
/// than the noise that a depth camera of consumer grade has there, from 1, 1.5, 2, 3, 4, 5, 6, 8, 10, ... steps; a band
/// of four voxels or three times the noise at the far end of depth; and the range that holds 98 % of depth.
MapProposal propose(const GeometrySample& sample, const Reading& reading);

}  // namespace felt
