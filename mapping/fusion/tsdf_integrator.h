#pragma once

#include <vector>

#include "core/frame.h"
#include "mapping/fusion/block_allocation.h"
#include "mapping/fusion/integration_config.h"
#include "mapping/fusion/label_fusion.h"
#include "mapping/fusion/tsdf_kernels.h"
#include "mapping/fusion/view_novelty.h"
#include "mapping/map.h"

namespace felt {

/// What fusing one frame did.
struct FrameStats {
  size_t blocks_in_view = 0;  ///< blocks near the measured surface
  LabelStats labels;
  double allocate_s = 0;  ///< finding and creating blocks
  double fuse_s = 0;      ///< updating every channel
};

/// Working memory of `integrate`, reused from frame to frame.
struct IntegrationScratch {
  AllocationScratch allocation;
  std::vector<uint32_t> blocks;
  std::vector<float> depth_scale;  ///< per pixel factor of the distance to the tangent plane
  ViewNovelty viewpoints;          ///< of the frames fused so far
};

/// Fuses one frame: the frame loop of the engine. Bit-identical for any number of threads (each block is written by one
/// task) and for every SIMD target. Non-finite and out-of-range depth is ignored.
FrameStats integrate(Map& map, const Frame& frame, const IntegrationConfig& config, IntegrationScratch& scratch);

/// The frame as the kernels see it. `scale` and `tiles` as in DepthView.
DepthView depth_view(const Frame& frame, const IntegrationConfig& config, const Map& map, const float* scale,
                     const DepthTiles* tiles = nullptr);

}  // namespace felt
