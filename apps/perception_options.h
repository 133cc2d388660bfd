#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "core/class_table.h"
#include "io/segmentation/perceived_sequence.h"

namespace felt::apps {

/// Options that say what is made of a frame's colour, shared by `reconstruct` and `segment`.
struct PerceptionArguments {
  std::filesystem::path net;  ///< description of the network; empty: none
  int top = 0;
  SegmentSource vote = SegmentSource::none;
  double color_step = FrameSegmentSettings{}.color_step;
  std::filesystem::path instances;
  bool asked() const { return !net.empty() || vote != SegmentSource::none; }
  void add_to(CLI::App& command, const char* group, const char* net_option);
};

/// Loads what the arguments ask for. Throws as `read_net_description` and `Segmenter` do.
Perception perception_of(const PerceptionArguments& arguments, const ClassTable& classes);

/// The settings as used, for reports.
nlohmann::ordered_json to_json(const PerceptionArguments& arguments);

}  // namespace felt::apps
