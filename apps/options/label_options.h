#pragma once

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json_fwd.hpp>

#include "core/class_table.h"
#include "io/settings/label_settings.h"
#include "mapping/fusion/integration_config.h"
#include "mapping/fusion/label_evidence.h"

namespace felt::apps {

/// The options about labels of commands that fuse a sequence.
void add_label_options(CLI::App& command, LabelSettings& settings);

/// What commands do unless told otherwise: docs/semantics.md says why.
LabelConfig standard_labels();
/// The numbers of the settings, where given, over the standard ones.
LabelConfig label_config(const LabelSettings& settings);

/// The settings as used, for the report and the map.
void add_to_json(const LabelSettings& settings, const LabelConfig& config, nlohmann::ordered_json& json);

/// What the settings make of a sequence's class table.
struct PreparedClasses {
  ClassTable table;                   ///< with priors, and with the ignored classes marked
  std::vector<uint16_t> ignored_ids;  ///< pixels of these leave no trace
  /// Of --confusion; null without. Outlives copies of the fusion's configuration.
  std::shared_ptr<const LabelEvidence> likelihood;
};

/// Throws IoError or ConfigError where the confusion matrix or a class name does not fit the table.
PreparedClasses prepare_classes(const LabelSettings& settings, const ClassTable& table);

}  // namespace felt::apps
