#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "apps/options/perception_options.h"
#include "apps/options/reading_options.h"
#include "io/sequence/reader.h"
#include "io/sequence/sequence_options.h"
#include "io/settings/label_settings.h"
#include "mapping/fusion/integration_config.h"

namespace felt::apps {

/// Everything that `reconstruct` can be told, checked.
struct ReconstructOptions {
  std::filesystem::path sequence, out;
  SequenceOptions reading;
  std::filesystem::path properties, touches;  ///< empty: what the sequence carries, if anything
  bool no_touches = false;                    ///< not even those
  double voxel_size_m = 0.02;
  double truncation_m = 0.08;
  std::string truncation = "4vox";                         ///< as given
  bool voxel_size_given = false, max_depth_given = false;  ///< else the sequence may know better
  IntegrationConfig fusion;
  PerceptionSettings perception;
  LabelSettings labels;
  bool overwrite = false;
  int64_t checkpoint_every = 0;  ///< frames; 0: only at the end
  bool resume = false;           ///< go on with the map in `out`, where there is one
  int threads = 0;               ///< 0: all hardware threads
};

/// The command line's own words. What is left empty keeps the default or the configuration file's value.
struct ReconstructArguments {
  std::filesystem::path config, sequence, out, properties, touches;
  bool no_touches = false;
  ReadingArguments reading;
  std::string truncation;
  std::optional<double> voxel_size_m, min_depth_m, max_depth_m, max_weight;
  std::optional<DistanceModel> distance;
  std::optional<WeightModel> weight;
  PerceptionSettings perception;
  LabelSettings label_settings;
  std::optional<bool> carve;
  bool overwrite = false, resume = false;
  std::optional<int64_t> checkpoint_every;
};

void add_reconstruct_options(CLI::App& command, ReconstructArguments& arguments);

/// Defaults, then the configuration file, then the command line (`threads`: its --threads, 0 where not given); checked
/// together. Throws ConfigError with every problem at once.
ReconstructOptions resolve(const ReconstructArguments& arguments, int threads);

/// Takes over what the sequence's sensor asks for where the user said nothing.
void adopt_sequence_defaults(const SequenceInfo& info, ReconstructOptions& options);

/// The settings as used, for the report and the map.
nlohmann::ordered_json to_json(const ReconstructOptions& options);

}  // namespace felt::apps
