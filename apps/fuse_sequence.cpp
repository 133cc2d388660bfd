#include "apps/fuse_sequence.h"

#include <spdlog/spdlog.h>

#include "mapping/tsdf_integrator.h"

namespace felt::apps {

FusionRecord fuse_sequence(DecodeAhead& frames, Map& map, const IntegrationConfig& config,
                           const std::function<std::string(const FusionRecord&)>& after_frame) {
  FusionRecord record;
  IntegrationScratch scratch;
  while (std::optional<ReadResult> next = frames.next()) {
    ++record.read;
    if (const auto* skipped = std::get_if<SkippedFrame>(&*next)) {
      ++record.skipped[skipped->reason];
      spdlog::info("frame {} skipped: {}: {}", skipped->index, skipped->reason, skipped->detail);
    } else {
      const FrameStats stats = integrate(map, std::get<Frame>(*next), config, scratch);
      ++record.fused;
      record.allocate_s += stats.allocate_s;
      record.fuse_s += stats.fuse_s;
      record.frame_ms.push_back(1e3 * (stats.allocate_s + stats.fuse_s));
    }
    record.stopped = after_frame(record);
    if (!record.stopped.empty()) break;
  }
  return record;
}

}  // namespace felt::apps
