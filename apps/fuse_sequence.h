#pragma once

#include <functional>

#include "apps/reconstruct_report.h"
#include "io/decode_ahead.h"
#include "mapping/integration_config.h"
#include "mapping/map.h"

namespace felt::apps {

/// Fuses frames in recorded order while later ones are decoded. `after_frame` is called with the record after every
/// frame, fused or skipped; a text that is not empty ends fusion there, with that reason: what was fused stays. Pixels
/// of `ignored_ids` leave no trace.
FusionRecord fuse_sequence(DecodeAhead& frames, Map& map, const IntegrationConfig& config,
                           const std::vector<uint16_t>& ignored_ids,
                           const std::function<std::string(const FusionRecord&)>& after_frame);

}  // namespace felt::apps
