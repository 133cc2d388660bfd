#include "io/settings/reconstruct_config.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "io/files/text_input.h"
#include "io/files/yaml_problems.h"
#include "io/sequence/pose_list.h"
#include "io/sequence/undistortion.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

constexpr size_t kLimitBytes = 1 << 20;

/// Reads one value into the configuration; throws ConfigError with its `where` for a value that cannot be used.
using ReadValue = std::function<void(const YAML::Node& value, const std::string& where)>;

std::string text_of(const YAML::Node& value, const std::string& where, const std::string& expected) {
  if (!value.IsScalar() || value.Scalar().empty())
    throw ConfigError(describe_mismatch(where, "value", expected,
                                        value.IsSequence() || value.IsMap() ? "a list or table" : "nothing"));
  return value.Scalar();
}

ReadValue number_into(std::optional<double>& target, double least, bool or_equal) {
  return [&target, least, or_equal](const YAML::Node& value, const std::string& where) {
    const std::string expected =
        std::string("a number ") + (or_equal ? "of at least " : "above ") + std::to_string(int(least));
    const std::string text = text_of(value, where, expected);
    const auto number = parse_number(text);
    if (!number || !std::isfinite(*number) || (or_equal ? *number < least : *number <= least))
      throw ConfigError(describe_mismatch(where, "value", expected, "'" + text + "'"));
    target = *number;
  };
}

ReadValue finite_into(std::optional<double>& target) {
  return [&target](const YAML::Node& value, const std::string& where) {
    const std::string text = text_of(value, where, "a number");
    const auto number = parse_number(text);
    if (!number || !std::isfinite(*number))
      throw ConfigError(describe_mismatch(where, "value", "a number", "'" + text + "'"));
    target = number;
  };
}

ReadValue whole_into(std::optional<int>& target, int least, int most) {
  return [&target, least, most](const YAML::Node& value, const std::string& where) {
    const std::string expected = "a whole number from " + std::to_string(least) + " to " + std::to_string(most);
    const std::string text = text_of(value, where, expected);
    const auto number = parse_integer(text);
    if (!number || *number < least || *number > most)
      throw ConfigError(describe_mismatch(where, "value", expected, "'" + text + "'"));
    target = int(*number);
  };
}

ReadValue number_within_into(std::optional<double>& target, double least, double most) {
  return [&target, least, most](const YAML::Node& value, const std::string& where) {
    const std::string expected = "a number from " + number_text(least) + " to " + number_text(most);
    const std::string text = text_of(value, where, expected);
    const auto number = parse_number(text);
    if (!number || !(*number >= least && *number <= most))
      throw ConfigError(describe_mismatch(where, "value", expected, "'" + text + "'"));
    target = number;
  };
}

ReadValue flag_into(std::optional<bool>& target) {
  return [&target](const YAML::Node& value, const std::string& where) {
    bool flag = false;
    if (!value.IsScalar() || !YAML::convert<bool>::decode(value, flag))
      throw ConfigError(
          describe_mismatch(where, "value", "true or false", "'" + text_of(value, where, "true or false") + "'"));
    target = flag;
  };
}

template <typename T>
ReadValue choice_into(std::optional<T>& target, const std::map<std::string, T>& choices) {
  return [&target, &choices](const YAML::Node& value, const std::string& where) {
    const std::string expected = "one of " + listed(choices, &std::pair<const std::string, T>::first);
    const std::string text = text_of(value, where, expected);
    const auto found = choices.find(text);
    if (found == choices.end()) throw ConfigError(describe_mismatch(where, "value", expected, "'" + text + "'"));
    target = found->second;
  };
}

template <typename T>
ReadValue parsed_into(std::optional<T>& target, T (*parse)(const std::string&, const std::string&)) {
  return [&target, parse](const YAML::Node& value, const std::string& where) {
    target = parse(text_of(value, where, "a text"), where);
  };
}

ReadValue path_into(fs::path& target, const fs::path& folder) {
  return [&target, folder](const YAML::Node& value, const std::string& where) {
    target = folder / text_of(value, where, "a path");
    if (std::error_code fault; !fs::exists(target, fault))
      throw ConfigError(describe_mismatch(where, "path", "an existing file or folder", "'" + target.string() + "'"));
  };
}

/// "fx,fy,cx,cy" or a list of four numbers.
void read_intrinsics_value(std::optional<Intrinsics>& target, const YAML::Node& value, const std::string& where) {
  std::string text;
  if (value.IsSequence())
    for (const YAML::Node& number : value)
      text += (text.empty() ? "" : ",") + (number.IsScalar() ? number.Scalar() : "?");
  else
    text = text_of(value, where, "[fx, fy, cx, cy]");
  target = parse_intrinsics(text, where);
}

/// "a,b" or a list of names.
void read_names(std::vector<std::string>& target, const YAML::Node& value, const std::string& where) {
  target.clear();
  if (value.IsSequence()) {
    for (const YAML::Node& name : value) target.push_back(text_of(name, where, "names of classes"));
  } else {
    const std::string text = text_of(value, where, "names of classes");
    for (const std::string_view name : split_words(text, ',')) target.emplace_back(name);
  }
}

std::map<std::string, ReadValue> readers_of(ReconstructConfig& c, const fs::path& folder) {
  return {
      {"labels", path_into(c.labels, folder)},
      {"probs", path_into(c.probs, folder)},
      {"classes", path_into(c.classes, folder)},
      {"properties", path_into(c.properties, folder)},
      {"touches", path_into(c.touches, folder)},
      {"format",
       [&c](const YAML::Node& value, const std::string& where) { c.format = text_of(value, where, "a layout"); }},
      {"frames", parsed_into(c.frames, parse_frame_selection)},
      {"intrinsics",
       [&c](const YAML::Node& value, const std::string& where) { read_intrinsics_value(c.intrinsics, value, where); }},
      {"depth_scale", number_into(c.depth_scale, 0, false)},
      {"depth_encoding", parsed_into(c.depth_encoding, parse_depth_encoding)},
      {"ray_length", flag_into(c.ray_length)},
      {"pose_convention", parsed_into(c.pose_convention, parse_pose_convention)},
      {"distortion", parsed_into(c.distortion, parse_distortion)},
      {"body_camera",
       [&c](const YAML::Node& value, const std::string& where) {
         try {
           c.T_body_camera = parse_pose(text_of(value, where, "a pose"), where);
         } catch (const FormatError& fault) {
           throw ConfigError(fault.what());
         }
       }},
      {"max_dt", number_into(c.max_dt_s, 0, false)},
      {"stamp_offset", finite_into(c.stamp_offset)},
      {"label_offset", whole_into(c.label_offset, -65535, 65535)},
      {"bgr", flag_into(c.bgr)},
      {"color", flag_into(c.color)},
      {"voxel_size", number_into(c.voxel_size_m, 0, false)},
      {"truncation",
       [&c](const YAML::Node& value, const std::string& where) {
         const std::string text = text_of(value, where, "metres, or voxels as 4vox");
         parse_truncation(text, 1, where);
         c.truncation = text;
       }},
      {"min_depth", number_into(c.min_depth_m, 0, true)},
      {"max_depth", number_into(c.max_depth_m, 0, false)},
      {"max_weight", number_into(c.max_weight, 1, true)},
      {"dropoff_start", number_into(c.dropoff_start_vox, 0, true)},
      {"color_band", number_into(c.color_band_vox, 0, true)},
      {"distance", choice_into(c.distance, kDistanceNames)},
      {"weight", choice_into(c.weight, kWeightNames)},
      {"carve", flag_into(c.carve)},
      {"label_band", number_into(c.label_settings.band_vox, 0, false)},
      {"label_evidence", number_into(c.label_settings.evidence, 0, false)},
      {"label_cap", number_into(c.label_settings.max_evidence, 0, true)},
      {"label_novelty", number_into(c.label_settings.novelty_m, 0, true)},
      {"label_turn", number_into(c.label_settings.novelty_deg, 0, true)},
      {"class_prior", number_into(c.label_settings.class_prior, 0, false)},
      {"confusion", path_into(c.label_settings.confusion, folder)},
      {"ignore_classes", [&c](const YAML::Node& value,
                              const std::string& where) { read_names(c.label_settings.ignore_classes, value, where); }},
      {"instances", flag_into(c.label_settings.instances)},
      {"spread_rest", flag_into(c.label_settings.spread_rest)},
      {"segmenter", path_into(c.perception.network, folder)},
      {"top", whole_into(c.perception.top, 0, kMostTopClasses)},
      {"vote", choice_into(c.perception.vote, kSegmentSourceNames)},
      {"masks", path_into(c.perception.masks, folder)},
      {"segment_color", number_within_into(c.perception.color_step, 0, kLargestColorStep)},
      {"checkpoint", whole_into(c.checkpoint_every, 0, INT_MAX)},
      {"threads", whole_into(c.threads, 0, 1024)},
  };
}

}  // namespace

const std::map<std::string, DistanceModel> kDistanceNames = {{"optical-axis", DistanceModel::optical_axis},
                                                             {"ray", DistanceModel::ray},
                                                             {"tangent-plane", DistanceModel::tangent_plane}};
const std::map<std::string, WeightModel> kWeightNames = {{"constant", WeightModel::constant},
                                                         {"inverse-square", WeightModel::inverse_square},
                                                         {"sensor-noise", WeightModel::sensor_noise}};

double parse_truncation(const std::string& text, double voxel_size_m, const std::string& where) {
  const bool in_voxels = text.ends_with("vox");
  const std::string_view digits(text.data(), text.size() - (in_voxels ? 3 : text.ends_with("m") ? 1 : 0));
  const auto number = parse_number(digits);
  if (!number || !std::isfinite(*number) || *number <= 0)
    throw ConfigError(describe_mismatch(where, "band around the surface", "metres such as 0.08, or voxels such as 4vox",
                                        "'" + text + "'"));
  return in_voxels ? *number * voxel_size_m : *number;
}

ReconstructConfig read_reconstruct_config(const fs::path& path) {
  ReconstructConfig config;
  const std::string content = read_whole_file(path, kLimitBytes);
  const std::map<std::string, ReadValue> readers = readers_of(config, path.parent_path());
  std::vector<std::string> known;
  for (const auto& [key, reader] : readers) known.push_back(key);
  YamlProblems found(path.string());
  try {
    const YAML::Node root = YAML::Load(content);
    if (!root.IsMap() && !root.IsNull())
      throw ConfigError(describe_mismatch(path.string(), "configuration", "keys and values", "something else"));
    std::set<std::string> seen;
    for (const auto& entry : root) {
      std::string key = entry.first.IsScalar() ? entry.first.Scalar() : std::string();
      std::replace(key.begin(), key.end(), '-', '_');
      const auto reader = readers.find(key);
      if (reader == readers.end()) {
        const std::string near = nearest_word(key, known);
        found.problem(entry.first, "key", near.empty() ? "one of " + listed(known) : "'" + near + "'", "'" + key + "'");
        continue;
      }
      if (!seen.insert(key).second) {
        found.problem(entry.first, "key", "each once", "'" + key + "' again");
        continue;
      }
      try {
        reader->second(entry.second, found.place(entry.first) + ": " + key);
      } catch (const ConfigError& fault) {
        found.problems.push_back(fault.what());
      }
    }
  } catch (const YAML::Exception& fault) {
    found.problems.push_back(yaml_fault(path.string(), fault));
  }
  if (!found.problems.empty()) throw ConfigError(found.problems);
  return config;
}

}  // namespace felt
