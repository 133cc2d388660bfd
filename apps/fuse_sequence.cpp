#include "apps/fuse_sequence.h"

#include <spdlog/spdlog.h>

#include "mapping/tsdf_integrator.h"

namespace felt::apps {

void fuse_sequence(DecodeAhead& frames, const FrameSource& source, const IntegrationConfig& config, Map& map,
                   FusionRecord& record, const std::function<std::string(const FusionRecord&)>& after_frame) {
  IntegrationScratch scratch;
  while (std::optional<ReadResult> next = frames.next()) {
    ++record.read;
    if (const auto* skipped = std::get_if<SkippedFrame>(&*next)) {
      ++record.skipped[skipped->reason];
      spdlog::info("frame {} skipped: {}: {}", skipped->index, skipped->reason, skipped->detail);
    } else {
      const Frame& frame = std::get<Frame>(*next);
      const FrameStats stats = integrate(map, frame, config, scratch);
      record_frame(map.frames, source.recording, source.settings, frame.index);
      ++record.fused;
      record.allocate_s += stats.allocate_s;
      record.fuse_s += stats.fuse_s;
      record.frame_ms.push_back(1e3 * (stats.allocate_s + stats.fuse_s));
    }
    record.stopped = after_frame(record);
    if (!record.stopped.empty()) break;
  }
}

}  // namespace felt::apps
