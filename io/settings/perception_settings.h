#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "io/segmentation/segment_source.h"

namespace felt {

/// Names on the command line and in configuration files.
extern const std::map<std::string, SegmentSource> kSegmentSourceNames;

inline constexpr int kMostTopClasses = 64;        ///< probabilities kept of a pixel
inline constexpr double kLargestColorStep = 450;  ///< grey levels: more than black and white are apart in all channels

/// What a user says about what is made of a frame's colour, on the command line or in a configuration file. What is
/// left out is empty.
struct PerceptionSettings {
  std::filesystem::path network;      ///< its description, net.yaml (io/segmentation/net_description.h)
  std::filesystem::path masks;        ///< folder of instance images, or of a folder of masks for each frame
  std::optional<int> top;             ///< probabilities kept of a pixel; 0: its label
  std::optional<SegmentSource> vote;  ///< segments whose pixels are given one class
  std::optional<double> color_step;   ///< grey levels at which geometric segments end, too; 0: colour does not matter
  bool votes_by(SegmentSource source) const { return vote.value_or(SegmentSource::none) == source; }
  bool active() const { return !network.empty() || !votes_by(SegmentSource::none); }
};

/// `first` where it says something, else `second`.
PerceptionSettings overlaid(PerceptionSettings first, const PerceptionSettings& second);

}  // namespace felt
