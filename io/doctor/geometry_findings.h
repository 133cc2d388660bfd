#pragma once

#include <vector>

#include "io/doctor/finding.h"
#include "io/doctor/geometry.h"

namespace felt {

/// One finding per component of a reading: what `best` says of it, how many frame pairs say so, and the option that
/// brings it about. `thorough` as given to `best_reading`.
std::vector<Finding> geometry_findings(const GeometrySample& sample, const Reading& best, bool thorough);

}  // namespace felt
