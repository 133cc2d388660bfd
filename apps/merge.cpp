#include <chrono>
#include <cstdio>
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
  std::optional<float> max_weight;
  bool overwrite = false;
};

/// With the cap that was given, else the one that all maps were made with, else the usual one.
MergeOptions with_cap(const Options& options, const std::vector<Map>& maps) {
  MergeOptions merge = options.merge;
  std::set<float> caps;
  for (const Map& map : maps)
    for (const FusedFrames& run : map.frames.runs)
      if (const auto settings = nlohmann::json::parse(run.settings, nullptr, false);
          settings.is_object() && settings.contains("max_weight") && settings["max_weight"].is_number())
        caps.insert(settings["max_weight"].get<float>());
  if (options.max_weight) {
    merge.max_weight = *options.max_weight;
  } else if (caps.size() == 1) {
    merge.max_weight = *caps.begin();
  } else if (caps.size() > 1) {
    throw ConfigError(describe_mismatch("merge", "cap of weights", "the same in all maps, or --max-weight",
                                        std::to_string(*caps.begin()) + " and " + std::to_string(*caps.rbegin())));
  }
  return merge;
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
  const Map result = merge(pointers, with_cap(options, maps));
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
}

}  // namespace felt::apps
