#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "core/class_table.h"
#include "core/confusion_matrix.h"
#include "core/image.h"

namespace felt {

/// What shares one draw from the confusion matrix, that is, how far a mistake reaches.
enum class ErrorScale : uint8_t {
  pixel,    ///< every pixel of every frame its own: the error that most papers assume
  segment,  ///< a thing (instance and class) in one frame
  scene,    ///< a thing in all frames: a network that is wrong for long
};

/// A segmentation network by its statistics.
struct LabelNetwork {
  ConfusionMatrix confusion;
  ErrorScale scale = ErrorScale::segment;
  /// Class probabilities kept per pixel; 0: labels only. They are P(true class | predicted class) for `class_share`:
  /// calibrated.
  int top = 0;
  /// Exponent applied to them before they are normalised: above 1 the network is surer than it is right.
  double sharpness = 1;
  std::vector<double> class_share = {};  ///< of each true class among the pixels; empty: uniform
};

/// "good", "medium" or "poor": right for about 92, 78 or 55 % of the pixels of a class (a few points more or less from
/// class to class). Most mistakes go to three other classes, look-alikes first: ice and snow, concrete and rock, wood
/// and plastic. Throws ConfigError for another name.
ConfusionMatrix preset_confusion(const std::string& name, const ClassTable& classes);
std::span<const char* const> preset_confusion_names();

struct NetworkOutput {
  LabelImage labels;               ///< class ids; 0 where the truth is ignored or unknown
  ProbabilityImage probabilities;  ///< empty where `top` is 0
};

/// What the network says of an image whose true labels and instances are known. A pure function of its arguments.
NetworkOutput run_network(const LabelNetwork& network, const ClassTable& classes, const LabelImage& true_labels,
                          const Image<uint16_t>& instances, uint64_t seed, int64_t frame);

}  // namespace felt
