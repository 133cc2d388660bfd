#include "apps/options/run_settings.h"

#include <algorithm>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>

#include "apps/options/perception_options.h"
#include "io/files/json_text.h"
#include "mapping/store/region_settings.h"

namespace felt::apps {
namespace {

/// An object without keys where a run says nothing that can be read.
nlohmann::json settings_of(const FusedFrames& run) {
  const nlohmann::json settings = nlohmann::json::parse(run.settings, nullptr, false);
  return settings.is_object() ? settings : nlohmann::json::object();
}

/// Whether a setting is of labels, and says nothing of a map without any.
bool is_of_labels(const std::string& key) {
  static const std::set<std::string> others = {"spread_rest", "confusion_content", "top",
                                               "vote",        "segment_color",     "segmenter_content"};
  return key.starts_with("label_") || others.contains(key);
}

/// By name, those of perception among the others; of contents (a confusion matrix, a network) the first digits of the
/// hash, which a person can tell apart. Empty where a run says nothing.
std::map<std::string, std::string> settings_as_text(const FusedFrames& run, bool with_labels) {
  constexpr size_t kDigits = 8;
  nlohmann::json settings = settings_of(run);
  if (settings.empty()) return {};
  if (settings.contains("color") && settings["color"] == false) settings.erase("bgr");
  settings.update(nlohmann::json::parse(json_text(to_json(PerceptionSettings()))));
  if (const nlohmann::json perception = settings.value("perception", nlohmann::json()); perception.is_object())
    settings.update(perception);
  settings.erase("perception");
  std::map<std::string, std::string> text;
  for (const auto& [key, value] : settings.items())
    if (with_labels || !is_of_labels(key))
      text[key] = key.ends_with("_content") && value.is_string() ? value.get<std::string>().substr(0, kDigits)
                                                                 : json_text(value);
  return text;
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

std::vector<std::string> different_settings(std::span<const Map> maps) {
  // What merging has a rule for, or refuses.
  const std::set<std::string> of_merge = {"voxel_size_m", "truncation_m",    "max_weight",     "carve", "label_cap",
                                          "class_prior",  "label_novelty_m", "label_turn_deg", "color", "instances"};
  // How a recording is read: options that may only repeat what it says itself (`RecordingAsRead` has what came of
  // them).
  const std::set<std::string> of_reading = {"format",       "intrinsics",    "depth_scale", "pose_convention",
                                            "distortion",   "T_body_camera", "ray_length",  "depth_encoding",
                                            "stamp_offset", "max_dt_s"};
  const std::set<std::string> of_a_recording = {"label_offset", "bgr"};
  struct Run {
    std::string recording;
    std::map<std::string, std::string> settings;
  };
  std::vector<Run> runs;
  std::set<std::string> keys;
  for (const Map& map : maps) {
    const bool with_labels = has_evidence(map);
    for (const FusedFrames& fused : map.frames.runs) {
      const auto settings = settings_as_text(fused, with_labels);
      for (const auto& [key, value] : settings)
        if (!of_merge.contains(key) && !of_reading.contains(key)) keys.insert(key);
      if (!settings.empty()) runs.push_back({fused.sequence, settings});
    }
  }
  std::vector<std::string> different;
  for (const std::string& key : keys) {
    std::map<std::string, std::set<std::string>> values;  // by recording, where that matters
    for (const Run& run : runs) {
      const auto found = run.settings.find(key);
      values[of_a_recording.contains(key) ? run.recording : ""].insert(found == run.settings.end() ? "none"
                                                                                                   : found->second);
    }
    for (const auto& [recording, unlike] : values)
      if (unlike.size() > 1) {
        different.push_back(key + ": " + *unlike.begin() + " and " + *unlike.rbegin());
        break;
      }
  }
  return different;
}

bool has_evidence(const Map& map) { return std::ranges::any_of(map.store.blocks(), &Block::has_evidence); }

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
