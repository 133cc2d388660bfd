#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "core/error.h"
#include "io/map_file/map_file.h"

namespace felt::apps {
namespace {

struct Options {
  CommonOptions common;
  std::string map;
};

int print(const Options& options, const nlohmann::json& report, const std::string& text) {
  if (options.common.json)
    print_json(report);
  else if (!options.common.quiet || !report.at("sound"))
    std::printf("%s", text.c_str());
  return report.at("sound") ? kDone : kDifferent;
}

int run(const Options& options) {
  nlohmann::json report = {{"map", options.map}, {"sound", false}, {"faults", nlohmann::json::array()}};
  try {
    const ExaminedMap examined = examine_map(options.map);
    const Map& map = examined.map;
    report["map_hash"] = map_hash(map);
    report["blocks"] = map.store.size();
    report["active_voxels"] = active_voxel_count(map);
    report["views"] = examined.views;
    std::string text;
    for (const MapFault& fault : examined.faults) {
      report["faults"].push_back({{"grid", fault.grid},
                                  {"broken", fault.broken},
                                  {"voxels", fault.voxels},
                                  {"first", {fault.first.x, fault.first.y, fault.first.z}}});
      text += options.map + ": " + fault.grid + ": not so: " + fault.broken;
      if (fault.voxels > 0)
        text += ": " + std::to_string(fault.voxels) + " voxels, the first at (" + std::to_string(fault.first.x) + ", " +
                std::to_string(fault.first.y) + ", " + std::to_string(fault.first.z) + ")";
      text += "\n";
    }
    report["sound"] = report["faults"].empty();
    if (report["sound"])
      text = options.map + ": sound: checksum, hash and every invariant of " + std::to_string(map.store.size()) +
             " blocks, and " + std::to_string(examined.views) + " views that follow from them\n";
    return print(options, report, text);
  } catch (const FormatError& error) {
    report["faults"].push_back({{"grid", "file"}, {"broken", error.what()}});
    return print(options, report, std::string(error.what()) + "\n");
  }
}

}  // namespace

void add_verify(CLI::App& app) {
  const auto options = std::make_shared<Options>();
  CLI::App& command =
      add_command(app,
                  {"verify", "Check a map file: checksum, hash, every invariant of its values, and its views",
                   "feltmap verify out/map.vdb\nfeltmap verify out/map.vdb --json"},
                  options->common, [options] { return run(*options); });
  command.add_option("MAP", options->map, "Map file (map.vdb)")->required();
}

}  // namespace felt::apps
