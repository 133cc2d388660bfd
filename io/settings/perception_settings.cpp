#include "io/settings/perception_settings.h"

namespace felt {

const std::map<std::string, SegmentSource> kSegmentSourceNames = {
    {"none", SegmentSource::none}, {"geometric", SegmentSource::geometric}, {"instances", SegmentSource::instances}};

PerceptionSettings overlaid(PerceptionSettings first, const PerceptionSettings& second) {
  if (first.network.empty()) first.network = second.network;
  if (first.masks.empty()) first.masks = second.masks;
  if (!first.top) first.top = second.top;
  if (!first.vote) first.vote = second.vote;
  if (!first.color_step) first.color_step = second.color_step;
  return first;
}

}  // namespace felt
