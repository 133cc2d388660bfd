#include "apps/options/run_settings.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "io/files/json_text.h"
#include "mapping/store/region_settings.h"

namespace felt::apps {
namespace {

/// An object without keys where a run says nothing that can be read.
nlohmann::json settings_of(const FusedFrames& run) {
  const nlohmann::json settings = nlohmann::json::parse(run.settings, nullptr, false);
  return settings.is_object() ? settings : nlohmann::json::object();
}

}  // namespace

std::set<double> numbers_of_runs(std::span<const Map> maps, const std::string& key) {
  std::set<double> numbers;
  for (const Map& map : maps)
    for (const FusedFrames& run : map.frames.runs)
      if (const nlohmann::json settings = settings_of(run); settings.contains(key) && settings[key].is_number())
        numbers.insert(settings[key].get<double>());
  return numbers;
}

std::set<std::string> values_of_runs(std::span<const Map> maps, const std::string& key) {
  std::set<std::string> values;
  for (const Map& map : maps)
    for (const FusedFrames& run : map.frames.runs)
      if (const nlohmann::json settings = settings_of(run); settings.contains(key))
        values.insert(json_text(settings[key]));
  return values;
}

bool any_run_with(std::span<const Map> maps, const std::string& flag) {
  return std::any_of(maps.begin(), maps.end(), [&](const Map& map) {
    return std::any_of(map.frames.runs.begin(), map.frames.runs.end(), [&](const FusedFrames& run) {
      const nlohmann::json settings = settings_of(run);
      return settings.contains(flag) && settings[flag] == true;
    });
  });
}

double least_observed_weight(const Map& map) {
  const bool by_depth = std::any_of(map.frames.runs.begin(), map.frames.runs.end(), [](const FusedFrames& run) {
    const nlohmann::json settings = settings_of(run);
    return settings.contains("weight") && settings["weight"] != "constant";
  });
  return by_depth ? double(std::numeric_limits<float>::min()) : RegionSettings().min_weight;
}

}  // namespace felt::apps
