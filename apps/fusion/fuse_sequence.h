#pragma once

#include <functional>
#include <string>

#include "apps/output/reconstruct_report.h"
#include "io/sequence/decode_ahead.h"
#include "mapping/fusion/integration_config.h"
#include "mapping/fusion/tsdf_integrator.h"
#include "mapping/map.h"

namespace felt::apps {

/// Where frames come from, as the frame journal names it.
struct FrameSource {
  std::string recording;  ///< SequenceInfo::fingerprint
  std::string settings;   ///< fusion_settings (apps/fusion/checkpoint.h)
};

/// Fuses frames in recorded order while later ones are decoded, notes each in the map's journal and goes on with
/// `record`. `after_frame` is called with the record after every frame, fused or skipped; a text that is not empty ends
/// fusion there, with that reason: what was fused stays. Pixels of `ignored_ids` leave no trace.
void fuse_sequence(DecodeAhead& frames, const FrameSource& source, const IntegrationConfig& config,
                   const std::vector<uint16_t>& ignored_ids, Map& map, IntegrationScratch& scratch,
                   FusionRecord& record, const std::function<std::string(const FusionRecord&)>& after_frame);

}  // namespace felt::apps
