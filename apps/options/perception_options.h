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

/// Where settings were said: on the command line, each in an option of its own, or in a file.
struct PerceptionSources {
  PerceptionSettings command_line;
  std::string net_option;      ///< of the command, for messages
  std::string users_of_masks;  ///< likewise
  std::string file;            ///< empty: none
};

/// Settings without what they are for are problems: of usage where the command line says them. What a file says and
/// only the --vote of the command line leaves without a use is dropped. `keeps_instances`: masks are for the map as
/// well.
void require_use(PerceptionSettings& settings, const PerceptionSources& from, bool keeps_instances, Problems& problems);

/// Loads what the settings ask for. Throws as `read_net_description` and `Segmenter` do.
Perception perception_of(const PerceptionSettings& settings, const ClassTable& classes);

/// The settings as used, for reports.
nlohmann::ordered_json to_json(const PerceptionSettings& settings);

}  // namespace felt::apps
