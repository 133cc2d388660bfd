#pragma once

#include <optional>

#include "core/class_table.h"
#include "io/doctor/cross_projection.h"
#include "io/doctor/finding.h"

namespace felt {

/// Whether red and blue are exchanged, from the balance of the sampled frames' colours: surfaces indoors and out are
/// mostly warm (wood, skin, walls in artificial light), so that the sum of R - B over pixels that are not pale is
/// positive: 0.35 to 1 of the sum of |R - B| in recordings looked at. Scenes of which a tenth is labelled snow, ice,
/// water or sky are not judged, nor unlabelled ones whose class table names these. Nothing where there is no colour.
/// `exchanged`: they are exchanged already as the sequence is read now.
std::optional<Finding> check_color_order(const std::vector<SampledFrame>& frames, const ClassTable& classes,
                                         bool exchanged);

}  // namespace felt
