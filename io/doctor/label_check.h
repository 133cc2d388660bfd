#pragma once

#include <optional>

#include "core/class_table.h"
#include "io/doctor/finding.h"
#include "io/doctor/geometry.h"

namespace felt {

/// Whether label ids are those of the class table: no pixel may have an id that the table lacks, and surfaces that are
/// named floor, wall or ceiling (or alike) must lie as such do, where up is the mean upward direction of the camera.
/// An offset of all ids by one breaks both. Nothing where there are no labels.
/// `label_offset`: that is added to ids already as the sequence is read now.
std::optional<Finding> check_labels(const GeometrySample& sample, const Reading& reading, const ClassTable& classes,
                                    int label_offset);

}  // namespace felt
