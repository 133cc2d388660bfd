#pragma once

#include <cstdint>
#include <vector>

#include "core/class_table.h"
#include "core/image.h"

namespace felt {

/// PNG bytes of class ids: 8 bits where every class of the table and every pixel fits, else 16.
std::vector<uint8_t> encode_labels(const LabelImage& labels, const ClassTable& classes);

/// PNG bytes of top-m probabilities as the generic layout stores them (docs/datasets.md): 16 bits, m planes of class
/// ids above m planes of probabilities times 65535.
std::vector<uint8_t> encode_probabilities(const ProbabilityImage& probabilities);

}  // namespace felt
