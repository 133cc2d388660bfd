#include <Eigen/Core>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <type_traits>
#include <vector>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/problems.h"
#include "apps/options/reading_options.h"
#include "apps/output/belief_report.h"
#include "core/error.h"
#include "core/text.h"
#include "io/map_file/map_file.h"
#include "io/map_file/map_grids.h"
#include "io/map_file/map_metadata.h"
#include "io/pictures/picture.h"
#include "io/pictures/sequence_picture.h"
#include "io/sequence/open_sequence.h"
#include "mapping/maps/crop.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json classes_json(const ClassTable& table) {
  Json classes = Json::array();
  for (const ClassInfo& info : table.classes()) classes.push_back({{"id", info.id}, {"name", info.name}});
  return classes;
}

/// Calls `visit(value)` for every active voxel of a grid.
template <typename Value, typename Visit>
void for_each_active(const Leaves<Value>& leaves, const Visit& visit) {
  std::vector<Value> values(kBlockVoxels);
  for (size_t i = 0; i < leaves.coords->size(); ++i)
    for_each_bit(leaves.fill(i, values.data()), [&](int v) { visit(values[size_t(v)]); });
}

/// Least, greatest and mean active value; of colours three of each, for red, green and blue.
template <typename Value>
Json grid_json(const Leaves<Value>& leaves) {
  using Numbers = Eigen::Array<double, std::is_same_v<Value, openvdb::Vec3s> ? 3 : 1, 1>;
  uint64_t active_voxels = 0;
  Numbers sum = Numbers::Zero(), least = Numbers::Constant(std::numeric_limits<double>::infinity()), greatest = -least;
  for_each_active(leaves, [&](const Value& value) {
    Numbers numbers;
    if constexpr (std::is_same_v<Value, openvdb::Vec3s>)
      numbers << double(value.x()), double(value.y()), double(value.z());
    else
      numbers << double(value);
    ++active_voxels;
    sum += numbers, least = least.min(numbers), greatest = greatest.max(numbers);
  });
  const auto json = [](const Numbers& numbers) {
    return numbers.size() == 1 ? Json(numbers[0]) : Json(std::vector<double>(numbers.begin(), numbers.end()));
  };
  Json entry = {{"active_voxels", active_voxels}};
  if (active_voxels > 0)
    entry.update({{"least", json(least)}, {"greatest", json(greatest)}, {"mean", json(sum / double(active_voxels))}});
  return entry;
}
Json grid_json(const Region& region) { return {{"active_voxels", region.voxels()}}; }

/// A mean of ids says nothing: how many voxels each class has, in the order of the class table.
Json label_json(const Leaves<int32_t>& leaves, const ClassTable& table) {
  uint64_t active_voxels = 0;
  std::map<int32_t, uint64_t> voxels;
  for_each_active(leaves, [&](int32_t id) { ++active_voxels, ++voxels[id]; });
  Json classes = Json::object();
  for (const ClassInfo& info : table.classes())
    if (const auto found = voxels.find(info.id); found != voxels.end()) classes[info.name] = found->second;
  return {{"active_voxels", active_voxels}, {"voxels_of_class", classes}};
}

/// Nor does one of instances' ids: how many instances there are.
Json instance_json(const Leaves<int32_t>& leaves) {
  uint64_t active_voxels = 0;
  std::set<int32_t> ids;
  for_each_active(leaves, [&](int32_t id) { ++active_voxels, ids.insert(id); });
  return {{"active_voxels", active_voxels}, {"instances", ids.size()}};
}

Json grids_json(const Map& map) {
  Json grids = Json::object();
  for (const LeafGrid& grid : map_grids(map))
    grids[grid.name] = grid.name == "label" ? label_json(std::get<Leaves<int32_t>>(grid.leaves), map.classes)
                       : grid.name == "instance"
                           ? instance_json(std::get<Leaves<int32_t>>(grid.leaves))
                           : std::visit([](const auto& leaves) { return grid_json(leaves); }, grid.leaves);
  return grids;
}

/// The property table; a support without end is left out.
Json properties_json(const PropertyTable& table) {
  Json properties = Json::array();
  for (const Property& property : table.properties()) {
    Json entry = {{"name", property.name}, {"unit", property.unit}, {"rho", property.rho}};
    if (std::isfinite(property.support_lo)) entry["at_least"] = property.support_lo;
    if (std::isfinite(property.support_hi)) entry["at_most"] = property.support_hi;
    entry["priors"] = Json::object();
    for (const auto& [name, prior] : property.priors)
      entry["priors"][name] = {{"mean", prior.mean}, {"sd", prior.sd}, {"readings", prior.readings}};
    properties.push_back(entry);
  }
  return properties;
}

/// Which frames of which recordings, a run of settings each; frames as [first, step, count].
Json recordings_json(const FrameJournal& journal) {
  Json recordings = Json::array();
  for (const FusedFrames& run : journal.runs)
    recordings.push_back({{"recording", run.sequence}, {"frames", frame_runs(run.frames)}});
  return recordings;
}

Json describe_map(const fs::path& file, bool with_grids) {
  const Map map = load_map(file);
  const Eigen::AlignedBox3d bounds_m = observed_bounds(map);
  Json json;
  json["kind"] = "map";
  json["path"] = file.string();
  json["file_bytes"] = fs::file_size(file);
  json["format_version"] = kMapFileVersion;
  json["voxel_size_m"] = map.voxel_size_m;
  json["truncation_m"] = map.truncation_m;
  json["blocks"] = map.store.size();
  json["active_voxels"] = active_voxel_count(map);
  if (!bounds_m.isEmpty())
    json["bounds_m"] = {{"min", point_json(bounds_m.min())}, {"max", point_json(bounds_m.max())}};
  json["bytes"] = {
      {"tsdf", map.store.geometry_bytes()}, {"color", map.store.color_bytes()}, {"classes", class_bytes(map)}};
  json["frames"] = frame_count(map.frames);
  json["recordings"] = recordings_json(map.frames);
  json["touches"] = map.touches.touches.size();
  json["classes"] = classes_json(map.classes);
  json["properties"] = properties_json(map.properties);
  if (with_grids) json["grids"] = grids_json(map);
  json["map_hash"] = map_hash(map);
  Json metadata = Json::object();
  for (const auto& [key, value] : map.metadata) {
    const Json parsed = Json::parse(value, nullptr, false);
    metadata[key] = parsed.is_discarded() ? Json(value) : parsed;
  }
  json["metadata"] = metadata;
  return json;
}

Json describe_sequence(const fs::path& folder, const SequenceOptions& options) {
  const auto sequence = open_sequence(folder, options);
  const SequenceInfo& info = sequence->info();
  const PinholeCamera& camera = info.camera;
  Json json;
  json["kind"] = "sequence";
  json["path"] = folder.string();
  json["format"] = info.layout;
  json["frames"] = sequence->size();
  json["camera"] = {{"width", camera.width}, {"height", camera.height}, {"fx", camera.fx},
                    {"fy", camera.fy},       {"cx", camera.cx},         {"cy", camera.cy}};
  json["depth_scale"] = info.depth_scale;
  json["pose_convention"] = info.pose_convention;
  json["color"] = info.has_color;
  json["labels"] = info.has_labels;
  json["probabilities"] = info.has_probabilities;
  json["instances"] = info.has_instances;
  json["classes"] = classes_json(info.classes);
  json["notes"] = info.notes;
  return json;
}

/// A value in a line: lists with commas, lists of lists with semicolons.
std::string text_of(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return number_text(value.get<double>(), "%.9g");
  if (value.is_null() || (value.is_structured() && value.empty())) return "none";
  if (!value.is_array()) return value.dump();
  std::string text;
  for (const Json& item : value) text += (text.empty() ? "" : value[0].is_array() ? "; " : ", ") + text_of(item);
  return text;
}

bool has_lines(const Json& value) {
  return !value.empty() && (value.is_object() || (value.is_array() && value[0].is_object()));
}

/// The map's own texts keep settings as JSON within JSON: makes those readable.
void open_settings(Json& texts) {
  for (Json& text : texts) {
    if (!text.is_object()) continue;
    for (Json& value : text) {
      if (!value.is_string()) continue;
      Json settings = Json::parse(value.get<std::string>(), nullptr, false);
      if (settings.is_structured()) value = std::move(settings);
    }
  }
}

/// Runs of frames, [first, step, count] each, in words.
std::string frames_text(const Json& runs) {
  return listed(runs, [](const Json& run) {
    const auto first = run[0].get<int64_t>(), step = run[1].get<int64_t>(), count = run[2].get<int64_t>();
    if (count == 1) return std::to_string(first);
    if (step == 0) return std::to_string(first) + " " + std::to_string(count) + " times";
    const std::string range = std::to_string(first) + " to " + std::to_string(first + step * (count - 1));
    return step == 1 ? range : range + " in steps of " + std::to_string(step);
  });
}

/// "name: value" lines, nested ones indented; of a list of things a line each, below which stands what is nested.
void print_lines(const Json& json, const std::string& indent) {
  for (const auto& [key, value] : json.items()) {
    std::printf("%s%s:%s\n", indent.c_str(), key.c_str(), has_lines(value) ? "" : (" " + text_of(value)).c_str());
    if (!has_lines(value)) continue;
    if (value.is_object()) {
      print_lines(value, indent + "  ");
      continue;
    }
    for (const Json& thing : value) {
      std::string line;
      Json nested = Json::object();
      for (const auto& [name, part] : thing.items())
        if (has_lines(part))
          nested[name] = part;
        else
          line += (line.empty() ? "" : ", ") + name + " " + text_of(part);
      std::printf("%s  %s\n", indent.c_str(), line.c_str());
      print_lines(nested, indent + "    ");
    }
  }
}

/// `thumbnails.png` and `trajectory.png` of a sequence.
void write_pictures(const fs::path& path, const SequenceOptions& options, const fs::path& folder) {
  std::error_code fault;
  fs::create_directories(folder, fault);
  if (fault) throw IoError(folder.string() + ": cannot be made: " + fault.message());
  write_png(folder / "thumbnails.png", thumbnail_sheet(*open_sequence(path, options)));
  write_png(folder / "trajectory.png", trajectory_picture(list_sequence(path, options)));
}

struct InfoOptions {
  fs::path path, pictures;
  ReadingArguments reading;
  std::vector<std::string> reading_given;  ///< options that say how to read a sequence
  bool grids = false;
  CommonOptions common;
};

/// What a map is not asked, and a sequence.
void check(const InfoOptions& o, bool is_map) {
  Problems problems;
  const auto expect = [&](bool good, const std::string& option, const char* expected) {
    if (!good) problems.add_of_usage(describe_mismatch(option, "what to describe", expected, o.path.string()));
  };
  expect(!is_map || o.pictures.empty(), "--pictures", "a sequence");
  for (const std::string& option : o.reading_given) expect(!is_map, option, "a sequence");
  expect(is_map || !o.grids, "--grids", "a map");
  problems.throw_if_any();
}

int run(const InfoOptions& o) {
  const fs::path& path = o.path;
  if (!fs::exists(path))
    throw IoError(describe_mismatch(path.string(), "what to describe", "a map file or a sequence", "nothing there"));
  const bool is_map = fs::is_regular_file(path) && !names_sequence(path);
  check(o, is_map);
  const SequenceOptions options = resolve(o.reading);
  Json json = is_map ? describe_map(path, o.grids) : describe_sequence(path, options);
  if (!o.pictures.empty()) write_pictures(path, options, o.pictures);
  if (o.common.json) {
    print_json(json);
  } else {
    if (is_map) {
      for (Json& recording : json["recordings"]) recording["frames"] = frames_text(recording["frames"]);
      open_settings(json["metadata"]);
    }
    print_lines(json, "");
  }
  return kDone;
}

}  // namespace

void add_info(CLI::App& app) {
  auto o = std::make_shared<InfoOptions>();
  CLI::App& command = add_command(app,
                                  {"info", "Say what a map or a sequence holds",
                                   "feltmap info result/map.vdb\nfeltmap info recording --json --pictures looks"},
                                  o->common, [o, &app] {
                                    for (const CLI::Option* option : app.get_subcommand("info")->get_options())
                                      if (option->get_group() == kReadingGroup && option->count() > 0)
                                        o->reading_given.push_back(option->get_name());
                                    return run(*o);
                                  });
  command.add_option("PATH", o->path, "A map file, or a folder (or .sens file) of a recorded sequence")->required();
  command.add_flag("--grids", o->grids,
                   "Of a map also every grid: active voxels, least, greatest and mean value; voxels of each class");
  command.add_option("--pictures", o->pictures, "Folder for thumbnails.png and trajectory.png of a sequence");
  add_reading_options(command, o->reading);
}

}  // namespace felt::apps
