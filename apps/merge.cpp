#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <vector>

#include "apps/command.h"
#include "apps/commands.h"
#include "apps/exit_code.h"
#include "apps/number_checks.h"
#include "apps/output_files.h"
#include "apps/run_settings.h"
#include "core/error.h"
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

bool has_evidence(const Map& map) {
  return std::any_of(map.store.blocks().begin(), map.store.blocks().end(),
                     [](const Block& block) { return !block.evidence.empty() || block.even_evidence != nullptr; });
}

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

int run(const Options& options) {
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](Clock::time_point a, Clock::time_point b) {
    return std::chrono::duration<double>(b - a).count();
  };
  const auto start = Clock::now();
  std::vector<Map> maps;
  maps.reserve(options.maps.size());
  std::vector<const Map*> pointers;
  for (const std::string& path : options.maps) pointers.push_back(&maps.emplace_back(load_map(path)));
  const auto loaded = Clock::now();
  MergeOptions merging = options.merge;
  merging.max_weight = cap(
      options.max_weight, maps, [](const Map&) { return true; }, "max_weight", "cap of weights", "--max-weight",
      merging.max_weight);
  merging.max_evidence = cap(options.max_evidence, maps, has_evidence, "label_cap", "cap of class evidence",
                             "--label-cap", merging.max_evidence);
  if (maps.size() > 1 && any_run_with(maps, "carve"))
    spdlog::warn("maps made with --carve: what one of them saw free does not erase what only another holds");
  const Map result = merge(pointers, merging);
  const MapWriting writing(options.out);
  require_nothing_lost(options.out, result, true, options.overwrite);
  const auto merged = Clock::now();
  const std::string hash = save_map(result, options.out);
  const auto saved = Clock::now();
  const nlohmann::json report = {
      {"out", options.out},
      {"maps", options.maps},
      {"frames", frame_count(result.frames)},
      {"blocks", result.store.size()},
      {"active_voxels", active_voxel_count(result)},
      {"map_hash", hash},
      {"time_s",
       {{"load", seconds(start, loaded)}, {"merge", seconds(loaded, merged)}, {"save", seconds(merged, saved)}}}};
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
      {"merge", "Join maps of the same world frame into one, as if all their frames had been fused together.",
       "feltmap merge monday/map.vdb tuesday/map.vdb --out both.vdb"},
      options->common, [options] { return run(*options); });
  command.add_option("MAPS", options->maps, "Map files")->required()->expected(1, -1);
  command.add_option("--out", options->out, "Map file to write")->required();
  command.add_flag("--force", options->overwrite,
                   "Replace a map although it holds frames or touches that these do not");
  command.add_flag("--allow-shared-frames", options->merge.allow_shared_frames,
                   "Merge although the journals share frames, which then count twice");
  command
      .add_option("--max-weight", options->max_weight,
                  "Cap of the summed weight [what the maps were made with, else 255]")
      ->check(above_zero());
  command
      .add_option("--label-cap", options->max_evidence,
                  "Cap of a voxel's class evidence, 0: none [what the maps were made with, else none]")
      ->check(at_least_zero());
}

}  // namespace felt::apps
