#pragma once

#include <cstddef>
#include <cstdint>

#include "core/image.h"

namespace felt {

/// Makes the classes of each segment one, as Ewen et al. 2024 clean a network's labels with class-agnostic masks.
/// `segments`: a number a pixel, 0 for none, of the labels' size. Pixels of no segment keep what they have.

/// Every pixel of a segment takes the id that most of its pixels hold (the lower id of equals), where that is at least
/// `least_share` of those that hold one; otherwise the segment is left as it is. Pixels with kNoLabel do not vote, but
/// take the winner.
void vote_labels(const Image<uint16_t>& segments, double least_share, LabelImage& labels);

/// Every pixel of a segment takes the mean of the segment's class probabilities, its `top` greatest. Pixels without a
/// prediction do not count, but take the mean. `own_weight` in [0, 1]: how much of its own probabilities a pixel keeps.
void pool_probabilities(const Image<uint16_t>& segments, double own_weight, ProbabilityImage& probabilities);

}  // namespace felt
