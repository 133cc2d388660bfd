#include "apps/fusion/fuse_sequence.h"

#include <spdlog/spdlog.h>

#include "core/error.h"
#include "mapping/fusion/block_allocation.h"
#include "mapping/labels/ignored_classes.h"

namespace felt::apps {

namespace {

/// Which unknown ids a frame's images hold, in pixels: looked at only where fusion met one.
void count_unknown_ids(const Frame& frame, const ClassTable& classes, std::map<uint16_t, uint64_t>& pixels) {
  const auto count = [&](const auto& ids) {
    for (const uint16_t id : ids)
      if (id != kNoLabel && !classes.known(id)) ++pixels[id];
  };
  if (frame.probabilities.empty())
    count(frame.labels);
  else
    count(frame.probabilities.class_id);
}

/// Why a frame is not fused: it could not be read, or lies where the map has no room.
std::optional<SkippedFrame> skip_of(const ReadResult& read, const Map& map, const IntegrationConfig& config) {
  if (const auto* skipped = std::get_if<SkippedFrame>(&read)) return *skipped;
  const Frame& frame = std::get<Frame>(read);
  if (on_map(frame.T_world_camera, map.voxel_size_m, config.max_depth_m + map.truncation_m)) return std::nullopt;
  return SkippedFrame{
      frame.index, "pose outside the map",
      describe_mismatch("pose", "farthest coordinate", "less than 2^30 voxels from the origin",
                        std::to_string(frame.T_world_camera.translation().cwiseAbs().maxCoeff()) + " m")};
}

}  // namespace

void fuse_sequence(DecodeAhead& frames, const FrameSource& source, const IntegrationConfig& config,
                   const std::vector<uint16_t>& ignored_ids, Map& map, IntegrationScratch& scratch,
                   FusionRecord& record, const std::function<std::string(const FusionRecord&)>& after_frame) {
  while (std::optional<ReadResult> next = frames.next()) {
    ++record.read;
    if (const std::optional<SkippedFrame> skipped = skip_of(*next, map, config)) {
      ++record.skipped[skipped->reason];
      spdlog::info("frame {} skipped: {}: {}", skipped->index, skipped->reason, skipped->detail);
    } else {
      Frame& frame = std::get<Frame>(*next);
      record.ignored_pixels += clear_depth_of(ignored_ids, frame);
      const FrameStats stats = integrate(map, frame, config, scratch);
      record.labels += stats.labels;
      record.without_labels += frame.labels.empty() && frame.probabilities.empty();
      if (stats.labels.unknown > 0) count_unknown_ids(frame, map.classes, record.unknown_ids);
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
