#pragma once

#include <cstdint>
#include <span>

#include "core/class_table.h"
#include "core/frame.h"
#include "mapping/fusion/integration_config.h"
#include "mapping/fusion/label_kernels.h"
#include "mapping/store/block_store.h"

namespace felt {

/// What one frame says about classes and instances, on the pixel grid of its depth. Images may be null or empty.
struct LabelView {
  const ClassTable* classes = nullptr;
  const LabelImage* labels = nullptr;               ///< ids of the table
  const ProbabilityImage* probabilities = nullptr;  ///< wins over labels where both are given
  const Image<uint16_t>* instances = nullptr;       ///< ids that belong to one thing in all frames; 0: none
  LabelConfig config;
  float band_m = 0;    ///< config.band_vox in metres
  float evidence = 0;  ///< of this frame: config.evidence times its novelty

  bool says_classes() const {
    return classes != nullptr && classes->size() > 0 && evidence > 0 &&
           ((labels != nullptr && !labels->empty()) || (probabilities != nullptr && !probabilities->empty()));
  }
  bool says_instances() const { return instances != nullptr && !instances->empty(); }
};

/// The view of a frame. `novelty`: of its viewpoint, in [0, 1]. Throws FormatError where an image has not the depth
/// image's size.
LabelView label_view(const Frame& frame, const ClassTable& classes, const LabelConfig& config, double voxel_size_m,
                     double novelty);

/// Observations of one block, or summed over blocks.
struct LabelStats {
  uint64_t voxels = 0;   ///< voxels that took evidence
  uint64_t unknown = 0;  ///< voxels whose pixel carried an id that the table does not know: nothing was fused
  uint64_t invalid = 0;  ///< voxels whose pixel's probabilities are no distribution: nothing was fused
  LabelStats& operator+=(const LabelStats& other) {
    voxels += other.voxels, unknown += other.unknown, invalid += other.invalid;
    return *this;
  }
};

/// Adds the evidence of one frame to the blocks' Dirichlet planes (INFERENCE: alpha_j += evidence of the pixel's class
/// j), for observed voxels nearer than the label band to the surface: a voxel behind another surface is farther from it
/// than that and takes nothing. Nothing else of the block is read or written but instance votes.
///
/// * A label adds `view.evidence` to its class, or what `config.likelihood` says of it; ignored classes add nothing;
///   unknown ids add nothing and are counted.
/// * Probabilities add `view.evidence` times p to each of their classes (through `config.likelihood` where given). The
///   mass that the m kept classes lack belongs to classes nobody named: it is spread evenly over all the table's other
///   classes where `config.spread_dropped`, so that a pixel always adds `view.evidence` in total; otherwise it is left
///   out, and a pixel adds that much less. A named class that is less probable than the unnamed ones' share counts as
///   unnamed; mass of ignored and unknown ids says nothing and is left out. A pixel with a probability that is
///   negative or not finite, or with a sum above 1.001, is left out and counted.
/// * Where the total evidence of a voxel would pass `config.max_evidence`, what is there is scaled down first:
///   exponential forgetting, so that a network that was wrong for long can be corrected.
/// * Where the view has instances, every voxel of the band votes for its pixel's id.
///
/// Creates planes for classes that the block sees for the first time. One task per block; any number of tasks, each
/// with its own LabelFusion. A block's planes are rarely in a cache: `add` sends for what the block will need and fuses
/// the block before it.
class LabelFusion {
public:
  LabelFusion(const LabelView& view, BlockStore& store) : view_(view), store_(store) {}
  LabelFusion(const LabelFusion&) = delete;
  LabelFusion& operator=(const LabelFusion&) = delete;

  /// `observation` is read before this returns, `block` written before the call after next or by `finish`.
  void add(const BlockObservation& observation, Block& block);
  /// Fuses what is left. To be called at the end of a task.
  LabelStats finish();

private:
  void fuse_waiting();

  const LabelView& view_;
  BlockStore& store_;
  BandVoxels bands_[2];
  int current_ = 0;
  Block* waiting_ = nullptr;  ///< not yet fused: bands_[1 - current_] of it
  LabelStats stats_;
};

}  // namespace felt
