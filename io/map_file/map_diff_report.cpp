#include "io/map_file/map_diff_report.h"

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "io/files/json_text.h"

namespace felt {

std::string to_json(const MapDifference& difference, const std::string& a, const std::string& b, double tolerance) {
  const auto number = [](double x) { return std::isfinite(x) ? nlohmann::json(x) : nlohmann::json(); };
  nlohmann::json channels = nlohmann::json::object();
  for (const ChannelDifference& c : difference.channels)
    channels[c.name] = {{"unit", c.unit},
                        {"voxels_only_a", c.voxels_only_a},
                        {"voxels_only_b", c.voxels_only_b},
                        {"voxels_both", c.voxels_both},
                        {"voxels_changed", c.voxels_changed},
                        {"max_difference", number(c.max_difference)},
                        {"mean_difference", number(c.mean_difference)}};
  nlohmann::json report = {
      {"a", a},
      {"b", b},
      {"tolerance", tolerance},
      {"differs", beyond(difference, tolerance)},
      {"same_hash", difference.same_hash},
      {"comparable", difference.comparable},
      {"settings", difference.settings},
      {"blocks",
       {{"only_a", difference.blocks_only_a}, {"only_b", difference.blocks_only_b}, {"both", difference.blocks_both}}},
      {"channels", channels},
      {"class_flips", difference.class_flips},
      {"touches",
       {{"only_a", difference.touches_only_a},
        {"only_b", difference.touches_only_b},
        {"both", difference.touches_both},
        {"undone_only_a", difference.undone_only_a},
        {"undone_only_b", difference.undone_only_b},
        {"regions_changed", difference.regions_changed},
        {"region_voxels_changed", difference.region_voxels_changed}}}};
  if (!difference.comparable)  // nothing was counted
    for (const char* key : {"blocks", "channels", "class_flips", "touches"}) report[key] = nullptr;
  return json_text(report, 2);
}

std::string to_text(const MapDifference& difference) {
  std::string text;
  for (const std::string& line : difference.settings) text += line + "\n";
  if (!difference.comparable) return text + "voxels do not coincide: nothing else compared\n";
  char line[256];
  std::snprintf(line, sizeof line, "blocks: %zu in both, %zu only in A, %zu only in B\n", difference.blocks_both,
                difference.blocks_only_a, difference.blocks_only_b);
  text += line;
  std::snprintf(line, sizeof line, "%-24s %12s %12s %12s %12s %14s %14s\n", "grid", "both", "only A", "only B",
                "changed", "max", "mean");
  text += line;
  for (const ChannelDifference& c : difference.channels) {
    std::snprintf(line, sizeof line, "%-24.160s %12zu %12zu %12zu %12zu %14.6g %14.6g", c.name.c_str(), c.voxels_both,
                  c.voxels_only_a, c.voxels_only_b, c.voxels_changed, c.max_difference, c.mean_difference);
    text += line + (c.unit.empty() ? "" : " " + c.unit) + "\n";
  }
  text += "class flips: " + std::to_string(difference.class_flips) + "\n";
  if (difference.undone_only_a + difference.undone_only_b > 0)
    text += "undone touches: " + std::to_string(difference.undone_only_a) + " only in A, " +
            std::to_string(difference.undone_only_b) + " only in B\n";
  const size_t touches = difference.touches_only_a + difference.touches_only_b + difference.touches_both;
  if (touches == 0) return text;
  std::snprintf(line, sizeof line,
                "touches: %zu in both, %zu only in A, %zu only in B; %zu regions differ, by %zu voxels\n",
                difference.touches_both, difference.touches_only_a, difference.touches_only_b,
                difference.regions_changed, difference.region_voxels_changed);
  return text + line;
}

}  // namespace felt
