#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "apps/options/problems.h"
#include "core/class_table.h"
#include "io/segmentation/perceived_sequence.h"
#include "io/settings/perception_settings.h"

namespace felt::apps {

/// Options that say what is made of a frame's colour, shared by `reconstruct` and `segment`; `net_option` names the
/// network.
void add_perception_options(CLI::App& command, PerceptionSettings& settings, const std::string& net_option);

/// Keeps what the settings ask for without what it needs.
void check(const PerceptionSettings& settings, const std::string& net_option, Problems& problems);

/// Loads what the settings ask for. Throws as `read_net_description` and `Segmenter` do.
Perception perception_of(const PerceptionSettings& settings, const ClassTable& classes);

/// The settings as used, for reports.
nlohmann::ordered_json to_json(const PerceptionSettings& settings);

}  // namespace felt::apps
