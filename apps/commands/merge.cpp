#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <vector>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/fusion/checkpoint.h"
#include "apps/options/number_checks.h"
#include "apps/options/run_settings.h"
#include "apps/output/output_files.h"
#include "core/error.h"
#include "core/stopwatch.h"
#include "core/text.h"
#include "io/map_file/map_file.h"
#include "mapping/maps/merge.h"

namespace felt::apps {
namespace {

struct Options {
  CommonOptions common;
  std::vector<std::string> maps;
  std::string out;
  MergeOptions merge;
  std::optional<float> max_weight, max_evidence;
  bool overwrite = false;
};

/// The cap that was given, else the one that all maps were made with which hold what it caps, else `usual`.
float cap(const std::optional<float>& given, const std::vector<Map>& maps, const std::function<bool(const Map&)>& holds,
          const char* key, const char* what, const char* option, float usual) {
  if (given) return *given;
  std::set<double> caps;
  for (const Map& map : maps)
    if (holds(map)) caps.merge(numbers_of_runs({&map, 1}, key));
  if (caps.size() > 1)
    throw ConfigError(describe_mismatch("merge", what, std::string("the same in all maps, or ") + option,
                                        std::to_string(*caps.begin()) + " and " + std::to_string(*caps.rbegin())));
  return caps.empty() ? usual : float(*caps.begin());
}

/// A touch counts where it does in one of the maps, whatever another one took back.
void warn_of_redone_touches(const std::vector<Map>& maps, const Map& result) {
  std::vector<std::string> ids;
  for (const Touch& touch : result.touches.touches)
    if (!touch.undone && std::any_of(maps.begin(), maps.end(), [&](const Map& map) {
          const Touch* there = map.touches.find(touch.id);
          return there != nullptr && there->undone;
        }))
      ids.push_back(id_text(touch.id));
  if (!ids.empty())
    spdlog::warn("undone in one of the maps and not in another, so that they count: touches {} (feltmap touch --undo)",
                 listed(ids, {}, 5));
}

/// The settings of two runs may be the same where the recording's own files were mended in between.
void warn_of_different_readings(const std::vector<Map>& maps) {
  std::vector<std::vector<RecordingAsRead>> recordings;
  for (const Map& map : maps) recordings.push_back(recordings_of(map));
  for (size_t i = 0; i < maps.size(); ++i)
    for (size_t j = 0; j < i; ++j) {
      std::set<std::string> names;
      for (const RecordingAsRead& a : recordings[j])
        for (const RecordingAsRead& b : recordings[i])
          if (a.content == b.content)
            std::ranges::copy(differences(a.reading, b.reading), inserter(names, names.end()));
      if (!names.empty())
        spdlog::warn(
            "maps {} and {} are of one recording that was understood in two ways ({}): what is added up was not "
            "measured alike",
            j + 1, i + 1, listed(names));
    }
}

/// Where the result is not what one run over all frames would give.
void warn_of_what_does_not_add(const std::vector<Map>& maps, const MergeOptions& merging) {
  if (maps.size() < 2) return;
  if (any_run_with(maps, "carve"))
    spdlog::warn("maps made with --carve: what one of them saw free does not erase what only another holds");
  if (const std::vector<std::string> different = different_settings(maps); !different.empty())
    spdlog::warn("maps fused with different settings ({}): what is added up was not measured alike", listed(different));
  warn_of_different_readings(maps);
  const auto any_above_zero = [&](const char* key) {
    const std::set<double> numbers = numbers_of_runs(maps, key);
    return !numbers.empty() && *numbers.rbegin() > 0;
  };
  if (std::any_of(maps.begin(), maps.end(), has_evidence) &&
      (any_above_zero("label_novelty_m") || any_above_zero("label_turn_deg")))
    spdlog::warn(
        "maps made with --label-novelty or --label-turn: viewpoints that only another map saw count as new ones, so "
        "that class evidence is more than that of one run");
  for (size_t i = 0; i < maps.size(); ++i)
    for (size_t j = 0; j < i; ++j) {
      if (!of_same_images_elsewhere(maps[j].frames, maps[i].frames)) continue;
      const size_t frames = merging.allow_shared_frames ? 0 : frames_of_same_images(maps[j].frames, maps[i].frames);
      spdlog::warn("maps {} and {} hold the same images with other poses or stamps: {}", j + 1, i + 1,
                   frames > 0 ? std::to_string(frames) + " frames count twice"
                              : "what is added up was not measured in one world frame");
    }
}

int run(const Options& options) {
  // From before it is read: a map may grow in place, and what others do to it meanwhile would be lost.
  std::optional<MapWriting> writing;
  if (std::filesystem::exists(options.out)) writing.emplace(options.out, options.overwrite);
  const Stopwatch loading;
  std::vector<Map> maps;
  maps.reserve(options.maps.size());
  std::vector<const Map*> pointers;
  for (const std::string& path : options.maps) pointers.push_back(&maps.emplace_back(load_map(path)));
  const double load_s = loading.seconds();
  const Stopwatch joining;
  MergeOptions merging = options.merge;
  merging.max_weight = cap(
      options.max_weight, maps, [](const Map&) { return true; }, "max_weight", "cap of weights", "--max-weight",
      merging.max_weight);
  merging.max_evidence = cap(options.max_evidence, maps, has_evidence, "label_cap", "cap of class evidence",
                             "--label-cap", merging.max_evidence);
  warn_of_what_does_not_add(maps, merging);
  Map result = merge(pointers, merging);
  warn_of_redone_touches(maps, result);
  forget_progress(result);
  if (!writing) writing.emplace(options.out, options.overwrite);
  require_nothing_lost(options.out, result, LostTouches::refuse, options.overwrite);
  const double merge_s = joining.seconds();
  const Stopwatch saving;
  const std::string hash = save_map(result, options.out);
  const double save_s = saving.seconds();
  const nlohmann::json report = {{"out", options.out},
                                 {"maps", options.maps},
                                 {"frames", frame_count(result.frames)},
                                 {"blocks", result.store.size()},
                                 {"active_voxels", active_voxel_count(result)},
                                 {"map_hash", hash},
                                 {"time_s", {{"load", load_s}, {"merge", merge_s}, {"save", save_s}}}};
  if (options.common.json)
    print_json(report);
  else if (!options.common.quiet)
    std::printf("%s: %zu maps merged: %zu frames, %zu blocks, hash %s\n", options.out.c_str(), maps.size(),
                frame_count(result.frames), result.store.size(), hash.c_str());
  return kDone;
}

}  // namespace

void add_merge(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  CLI::App& command = add_command(
      app,
      {"merge", "Join maps of the same world frame into one, as if all their frames had been fused together",
       "feltmap merge monday/map.vdb tuesday/map.vdb --out both.vdb"},
      options->common, [options] { return run(*options); });
  command.add_option("MAPS", options->maps, "Map files")->required()->expected(1, -1);
  command.add_option("--out", options->out, "Map file to write")->required();
  command.add_flag("--force", options->overwrite,
                   "Replace a map although it holds frames, voxels or touches that these do not");
  command.add_flag("--allow-shared-frames", options->merge.allow_shared_frames,
                   "Merge although the journals share frames, which then count twice");
  command
      .add_option("--max-weight", options->max_weight,
                  "Cap of the summed weight [what the maps were made with, else 255]")
      ->check(at_least_one());
  command
      .add_option("--label-cap", options->max_evidence,
                  "Cap of a voxel's class evidence, 0: none [what the maps were made with, else none]")
      ->check(at_least_zero());
}

}  // namespace felt::apps
