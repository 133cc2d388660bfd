#pragma once

#include "io/doctor/finding.h"
#include "io/doctor/geometry.h"
#include "io/sequence/reader.h"

namespace felt {

/// Whether neighbouring frames see the same surfaces where their poses say so, under the best reading: poses in another
/// order than the images fit nowhere; a jump of the trajectory fits on both sides of it but not across. The largest
/// steps of the whole trajectory are decoded from `reader` and tried one by one.
Finding check_trajectory(const GeometrySample& sample, const Reading& best, const SequenceReader& reader);

}  // namespace felt
