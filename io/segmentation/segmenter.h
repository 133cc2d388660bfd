#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <vector>

#include "core/class_table.h"
#include "core/image.h"
#include "io/segmentation/network.h"
#include "io/segmentation/top_classes.h"

namespace felt {

/// From colour to class probabilities: a network whose classes are mapped onto a class table.
///
/// The image is resized to the network's input (bilinear, the whole image whatever its shape), normalised, run, and the
/// output interpolated back to the image's pixels. Any number of threads may call `segment` at once; each then runs a
/// network of its own, so the result does not depend on them.
class Segmenter {
public:
  /// Loads one network, which finds what is wrong with it. `classes`: the user's table; an empty one is replaced by the
  /// network's own classes. Throws as `load_net_model`, `open_network` and `map_classes` do.
  Segmenter(const NetDescription& net, const ClassTable& classes);

  const ClassTable& classes() const { return classes_; }
  const NetDescription& description() const { return model_.description; }

  /// The `top` >= 1 most probable classes of each pixel, by id of `classes()`. Probability mapped to none is an entry
  /// like others, with the id of the table's first ignored class, or kNoLabel where it has none. Throws FormatError
  /// naming the model and the frame where the output holds what no probability or logit can be.
  ProbabilityImage segment(const ColorImage& color, int top, int64_t frame = 0) const;

  /// The input of the network for an image: [3, height, width] in its order and normalisation.
  Planes input_of(const ColorImage& color) const;
  /// The network's bare output for an image.
  Planes run(const ColorImage& color) const;

private:
  NetModel model_;
  ClassTable classes_;
  std::vector<uint16_t> target_;        ///< per plane of the output: number of the class it stands for
  std::vector<uint16_t> id_of_target_;  ///< by that number: class id, or kNoLabel for none
  mutable std::mutex mutex_;
  mutable std::vector<std::unique_ptr<Network>> idle_;
};

/// Ids of the most probable class of each pixel.
LabelImage most_probable_labels(const ProbabilityImage& probabilities);

}  // namespace felt
