#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/image.h"
#include "io/segmentation/network.h"

namespace felt {

/// Class probabilities on a grid, cell-major: class c of cell (u, v) at `[(v * width + u) * classes + c]`.
struct ClassGrid {
  int classes = 0, width = 0, height = 0;
  std::vector<float> probability;
};

/// Sums the planes of a network over the classes of the map that they stand for: plane i goes to class `target[i]` of
/// 0 .. classes - 1. Logits go through a softmax over the planes first; a plane of labels gives its class
/// probability 1. A cell whose values cannot be what `kind` says (not finite; probabilities that are negative or do not
/// sum to 1 within 1 %; no number of a class) gives its index v * width + u, and the grid is incomplete; else -1.
int64_t class_grid(const Planes& planes, std::span<const uint16_t> target, int classes, NetOutput kind,
                   ClassGrid& grid);

/// The `top` most probable classes of each pixel of an image of another size, from probabilities interpolated
/// bilinearly (grids aligned at their outer edges, clamped, as cv::resize does), the most probable first and the lower
/// class of equals. Entries hold class numbers of the grid; entries beyond its number of classes have probability 0.
ProbabilityImage top_classes(const ClassGrid& grid, int width, int height, int top);

}  // namespace felt
