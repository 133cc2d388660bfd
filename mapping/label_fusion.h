#pragma once

#include <cstdint>

#include "core/class_table.h"
#include "core/frame.h"
#include "mapping/block_store.h"
#include "mapping/integration_config.h"
#include "mapping/tsdf_kernels.h"

namespace felt {

/// What one frame says about classes, on the pixel grid of its depth. Either image may be empty.
struct LabelView {
  const ClassTable* classes = nullptr;
  const LabelImage* labels = nullptr;               ///< ids of the table
  const ProbabilityImage* probabilities = nullptr;  ///< wins over labels where both are given
  LabelConfig config;
  float band_m = 0;  ///< config.band_vox in metres
};

/// Observations of one block, or summed over blocks.
struct LabelStats {
  uint64_t voxels = 0;   ///< voxels that took evidence
  uint64_t unknown = 0;  ///< voxels whose pixel carried an id that the table does not know: nothing was fused
  LabelStats& operator+=(const LabelStats& other) {
    voxels += other.voxels, unknown += other.unknown;
    return *this;
  }
};

/// Adds the evidence of one frame to the block's Dirichlet planes (INFERENCE: alpha_j += evidence of the pixel's class
/// j), for observed voxels nearer than the label band to the surface: a voxel behind another surface is farther from it
/// than that and takes nothing.
///
/// * A label adds `config.evidence` to its class; ignored classes add nothing; unknown ids add nothing and are counted.
/// * Probabilities add `config.evidence` times p to each of their classes. The mass that the m kept classes lack
/// belongs to
///   classes nobody named: it is spread evenly over all the table's other classes where `config.spread_dropped`, so
///   that a pixel always adds `config.evidence` in total; otherwise it is left out, and a pixel adds that much less.
/// * Where the total evidence of a voxel would pass `config.max_evidence`, what is there is scaled down first:
/// exponential
///   forgetting, so that a network that was wrong for long can be corrected.
///
/// Creates planes for classes that the block sees for the first time. One task per block; any number of tasks.
LabelStats fuse_labels(const BlockObservation& observation, const LabelView& view, Block& block, BlockStore& store);

/// Sum of the block's evidence for one voxel, without the prior.
float total_evidence(const Block& block, int offset);

}  // namespace felt
