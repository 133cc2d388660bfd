#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/confusion_matrix.h"
#include "core/frame.h"
#include "core/property_table.h"
#include "mapping/evaluation/evaluate_labels.h"
#include "mapping/map.h"

// Maps of one recording with true labels, seen by a simulated network and touched in simulation.
namespace felt::paper {

/// A recording with the truth: `Frame::labels` are true, `Frame::instances` given.
struct Recording {
  std::vector<Frame> frames;
  ClassTable classes;
  Property property;  ///< that touches measure; classes without a prior are not touched
  double voxel_size_m = 0.02;
  double max_depth_m = 4;
};

/// The same classes with this concentration each before anything was seen.
ClassTable with_prior(const ClassTable& classes, double prior);

/// How a map takes the network's labels.
enum class Evidence {
  counts,  ///< one count a pixel for its label on the paper's prior of 1: what semantic mappers do
  /// P(true class | label) from the network's confusion and the classes' shares, on a prior of one count for all
  /// classes together: the frames repeat one judgement, and its probabilities are to stand.
  calibrated,
};

/// A network that is wrong about whole things in all frames, with this confusion.
struct NetworkLabels {
  std::vector<LabelImage> labels;               ///< by frame
  std::vector<ProbabilityImage> probabilities;  ///< by frame, calibrated
};
NetworkLabels network_labels(const Recording& recording, const ConfusionMatrix& confusion, uint64_t seed);

Map fused(const Recording& recording, const NetworkLabels& network, Evidence evidence);

/// A reading of the property at a place of the surface.
struct Reading {
  Eigen::Vector3d point_m;
  double value = 0;
};

/// The paper's protocol: each thing that the network mistakes and whose true class has a prior is touched `times`
/// times, where it is seen best. Readings are drawn from the true class's prior, with its correlation within a thing.
std::vector<Reading> readings_where_wrong(const Recording& recording, const NetworkLabels& network, int times,
                                          uint64_t seed);

/// Applies readings and returns how many the map refused (no labelled surface there).
int touch(Map& map, const Recording& recording, const std::vector<Reading>& readings);
/// Takes every touch back, exactly.
void undo_touches(Map& map);
/// The honest protocol: `count` touches, each at the place that `suggest_touches` ranks first in the map so far; the
/// truth only draws the reading. Returns how many were made.
int touch_as_suggested(Map& map, const Recording& recording, int count, uint64_t seed);

/// Against the true labels of all frames.
LabelScores score(const Map& map, const Recording& recording, bool class_images);

}  // namespace felt::paper
