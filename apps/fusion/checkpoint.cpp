#include "apps/fusion/checkpoint.h"

#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "apps/options/problems.h"
#include "core/error.h"
#include "io/files/json_number.h"
#include "io/files/json_text.h"
#include "io/map_file/map_file.h"
#include "mapping/maps/merge.h"

namespace felt::apps {
namespace {

using nlohmann::json;

// Keys of Map::metadata.
constexpr const char* kConfig = "config";
constexpr const char* kProgress = "progress";
constexpr const char* kRecording = "recording";

/// Twelve numbers a pose, row by row: JSON keeps every bit of them.
json poses_json(const std::vector<Eigen::Isometry3d>& poses) {
  json rows = json::array();
  for (const Eigen::Isometry3d& pose : poses) {
    json row = json::array();
    for (int i = 0; i < 12; ++i) row.push_back(pose.matrix()(i / 4, i % 4));
    rows.push_back(row);
  }
  return rows;
}

std::vector<Eigen::Isometry3d> poses_of(const json& rows) {
  std::vector<Eigen::Isometry3d> poses;
  for (const json& row : rows) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (int i = 0; i < 12; ++i) pose.matrix()(i / 4, i % 4) = row.at(size_t(i)).get<double>();
    poses.push_back(pose);
  }
  return poses;
}

json progress_of(const FusionRecord& record, const std::vector<Eigen::Isometry3d>& viewpoints, bool complete,
                 const std::string& touches) {
  json unknown = json::array();
  for (const auto& [id, pixels] : record.unknown_ids) unknown.push_back({id, pixels});
  return {{"complete", complete},
          {"read", record.read},
          {"fused", record.fused},
          {"skipped", record.skipped},
          {"label_voxels", {record.labels.voxels, record.labels.unknown, record.labels.invalid}},
          {"unknown_ids", unknown},
          {"ignored_pixels", record.ignored_pixels},
          {"without_labels", record.without_labels},
          {"touches", touches},
          {"viewpoints", poses_json(viewpoints)}};
}

/// No object where the map has no such text, or one that is none.
json text_of(const Map& map, const char* key) {
  const auto found = map.metadata.find(key);
  return found == map.metadata.end() ? json() : json::parse(found->second, nullptr, false);
}

json required_text_of(const Map& map, const char* key, const std::string& where) {
  const json text = text_of(map, key);
  if (text.is_object()) return text;
  std::string instead = "something else";
  if (map.metadata.contains(std::string(key) + " 1"))  // as merge numbers them
    instead = "those of several runs: a merged map cannot be continued";
  else if (!map.metadata.contains(key))
    instead = "none: a merged map, a part of one, or another map that cannot be continued";
  throw FormatError(
      describe_mismatch(where, std::string("text '") + key + "'", "that of a map of reconstruct", instead));
}

void read_progress(const json& progress, const std::string& where, Checkpoint& checkpoint) {
  try {
    FusionRecord& record = checkpoint.record;
    record.read = whole_number<int64_t>(progress.at("read"));
    record.fused = whole_number<int64_t>(progress.at("fused"));
    progress.at("skipped").get_to(record.skipped);
    const json& labels = progress.at("label_voxels");
    record.labels = {whole_number<uint64_t>(labels.at(0)), whole_number<uint64_t>(labels.at(1)),
                     whole_number<uint64_t>(labels.at(2))};
    for (const json& row : progress.at("unknown_ids"))
      record.unknown_ids[whole_number<uint16_t>(row.at(0))] = whole_number<uint64_t>(row.at(1));
    progress.at("ignored_pixels").get_to(record.ignored_pixels);
    record.without_labels = progress.value("without_labels", int64_t{0});
    checkpoint.viewpoints = poses_of(progress.at("viewpoints"));
    progress.at("complete").get_to(checkpoint.complete);
    checkpoint.touches = progress.value("touches", "");
  } catch (const std::exception& fault) {
    throw FormatError(describe_mismatch(where, "text 'progress'", "what reconstruct counts", fault.what()));
  }
}

json recording_json(const SequenceInfo& sequence) {
  return {{"recording", sequence.content}, {"reading", sequence.reading}};
}

RecordingAsRead recording_from(const json& text) {
  RecordingAsRead recording;
  if (const auto content = text.find("recording"); content != text.end() && content->is_string())
    recording.content = *content;
  const json reading = text.value("reading", json::object());
  for (const auto& [name, said] : reading.items())
    if (said.is_string()) recording.reading[name] = said;
  return recording;
}

void require_same_recording(const RecordingAsRead& then, const Map& map, const SequenceInfo& now,
                            const std::string& where) {
  if (then.content == now.content) return;
  const bool same_beginning = !map.frames.runs.empty() && map.frames.runs.back().sequence == now.fingerprint;
  throw ConfigError(describe_mismatch(
      "--resume", "recording", "the one that " + where + " was made of",
      same_beginning ? "that one, but it has grown or changed since (fuse its new frames with --frames into another "
                       "folder and join both with feltmap merge, or begin again: --force instead of --resume)"
                     : "another"));
}

/// What the recording itself says may be mended between two runs: a scale, a camera, labels.
void require_same_reading(const RecordingAsRead& then, const SequenceInfo& now, const std::string& where) {
  Problems problems;
  for (const std::string& name : differences(then.reading, now.reading)) {
    const std::string was = json_text(json(then.reading.at(name))), is = json_text(json(now.reading.at(name)));
    const bool images = name == "label images";
    problems.add(describe_mismatch("--resume", "the recording's " + name,
                                   images ? "those that " + where + " was made of" : was + " as in " + where,
                                   images ? "others" : is));
  }
  problems.throw_if_any();
}

/// A file or folder may be named in another way, and what matters is its content, which is compared elsewhere or kept
/// beside the name. Of touches it matters here that there are any: those of an unfinished run come with its last frame.
json comparable(json config) {
  for (const char* key : {"sequence", "labels", "probs", "classes", "properties", "confusion"}) config.erase(key);
  if (config.contains("perception"))
    for (const char* key : {"segmenter", "masks"}) config["perception"].erase(key);
  if (config.contains("touches")) config["touches"] = "given";
  return config;
}

/// Settings that decide which depth image gets which pose, so that with another one all frames look changed.
bool frames_differ_by_settings(const json& were, const json& are) {
  for (const char* key : {"max_dt_s", "stamp_offset"})
    if (were.value(key, json()) != are.value(key, json())) return true;
  return false;
}

void require_same_run(const json& were, const json& are, const std::string& where) {
  const json then = comparable(were), now = comparable(are);
  std::set<std::string> keys;
  for (const json* config : {&then, &now})
    for (const auto& [key, value] : config->items()) keys.insert(key);
  Problems problems;
  for (const std::string& key : keys)
    if (const json was = then.value(key, json()), is = now.value(key, json()); was != is)
      problems.add(describe_mismatch("--resume", key, json_text(was) + " as in " + where, json_text(is)));
  problems.throw_if_any();
}

}  // namespace

std::string fusion_settings(const nlohmann::ordered_json& config) {
  nlohmann::ordered_json shaping = config;
  for (const char* key :
       {"sequence", "frames", "labels", "probs", "classes", "properties", "touches", "no_touches", "confusion"})
    shaping.erase(key);
  if (shaping.contains("perception"))
    for (const char* key : {"segmenter", "masks"}) shaping["perception"].erase(key);
  return json_text(shaping);
}

std::string save_checkpoint(Map& map, const FusionRecord& record, const std::vector<Eigen::Isometry3d>& viewpoints,
                            bool complete, const std::string& touches, const SequenceInfo& sequence,
                            const nlohmann::ordered_json& config, const std::filesystem::path& path) {
  map.metadata[kConfig] = json_text(config);
  map.metadata[kProgress] = json_text(progress_of(record, viewpoints, complete, touches));
  map.metadata[kRecording] = json_text(recording_json(sequence));
  // On the way nobody looks at views, and they take longer than the rest.
  return save_map(map, path, {.views = complete || !record.stopped.empty()});
}

std::vector<RecordingAsRead> recordings_of(const Map& map) {
  std::vector<RecordingAsRead> recordings;
  for (const auto& [key, text] : map.metadata)
    if (without_number(key) == kRecording)
      if (const json parsed = json::parse(text, nullptr, false); parsed.is_object())
        recordings.push_back(recording_from(parsed));
  return recordings;
}

std::vector<std::string> differences(const Reading& a, const Reading& b) {
  std::vector<std::string> names;
  for (const auto& [name, text] : a)
    if (const auto other = b.find(name); other != b.end() && other->second != text) names.push_back(name);
  return names;
}

void forget_progress(Map& map) { map.metadata.erase(kProgress); }

std::optional<Checkpoint> resume(const std::filesystem::path& path, const SequenceInfo& sequence,
                                 const nlohmann::ordered_json& config) {
  if (!std::filesystem::exists(path)) return std::nullopt;
  Map map = load_map(path);
  const std::string where = path.string();
  const json progress = required_text_of(map, kProgress, where);
  const json said = text_of(map, kRecording);  // earlier maps say it beside their progress
  const RecordingAsRead recording = recording_from(said.is_object() ? said : progress);
  const json config_then = required_text_of(map, kConfig, where), config_now = json::parse(json_text(config));
  if (!frames_differ_by_settings(config_then, config_now)) require_same_recording(recording, map, sequence, where);
  require_same_run(config_then, config_now, where);
  require_same_reading(recording, sequence, where);
  Checkpoint checkpoint{std::move(map), {}, {}, false, {}};
  read_progress(progress, where, checkpoint);
  return checkpoint;
}

}  // namespace felt::apps
