#include <algorithm>
#include <cstdio>
#include <limits>
#include <nlohmann/json.hpp>
#include <type_traits>
#include <vector>

#include "apps/command.h"
#include "apps/commands.h"
#include "apps/exit_code.h"
#include "apps/reading_options.h"
#include "core/error.h"
#include "io/map_file/map_file.h"
#include "io/map_file/map_grids.h"
#include "io/pictures/picture.h"
#include "io/pictures/sequence_picture.h"
#include "io/sequence/open_sequence.h"
#include "mapping/maps/crop.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Json vector_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json classes_json(const ClassTable& table) {
  Json classes = Json::array();
  for (const ClassInfo& info : table.classes()) classes.push_back({{"id", info.id}, {"name", info.name}});
  return classes;
}

/// Of numbers also the least, greatest and mean active value.
template <typename Value>
Json grid_json(const Leaves<Value>& leaves) {
  uint64_t active_voxels = 0;
  double sum = 0, least = std::numeric_limits<double>::infinity(), greatest = -least;
  std::vector<Value> values(kBlockVoxels);
  for (size_t i = 0; i < leaves.coords->size(); ++i)
    for_each_bit(leaves.fill(i, values.data()), [&](int v) {
      ++active_voxels;
      if constexpr (std::is_same_v<Value, float>) {
        const double value = double(values[size_t(v)]);
        sum += value, least = std::min(least, value), greatest = std::max(greatest, value);
      }
    });
  Json entry = {{"active_voxels", active_voxels}};
  if (std::is_same_v<Value, float> && active_voxels > 0)
    entry.update({{"least", least}, {"greatest", greatest}, {"mean", sum / double(active_voxels)}});
  return entry;
}
Json grid_json(const Region& region) { return {{"active_voxels", region.voxels()}}; }

Json grids_json(const Map& map) {
  Json grids = Json::object();
  for (const LeafGrid& grid : map_grids(map))
    grids[grid.name] = std::visit([](const auto& leaves) { return grid_json(leaves); }, grid.leaves);
  return grids;
}

Json describe_map(const fs::path& file, bool with_grids) {
  const Map map = load_map(file);
  const Eigen::AlignedBox3d bounds_m = observed_bounds(map);
  Json json;
  json["kind"] = "map";
  json["path"] = file.string();
  json["file_bytes"] = fs::file_size(file);
  json["voxel_size_m"] = map.voxel_size_m;
  json["truncation_m"] = map.truncation_m;
  json["blocks"] = map.store.size();
  json["active_voxels"] = active_voxel_count(map);
  if (!bounds_m.isEmpty())
    json["bounds_m"] = {{"min", vector_json(bounds_m.min())}, {"max", vector_json(bounds_m.max())}};
  json["bytes"] = {
      {"tsdf", map.store.geometry_bytes()}, {"color", map.store.color_bytes()}, {"classes", class_bytes(map)}};
  json["frames"] = frame_count(map.frames);
  json["touches"] = map.touches.touches.size();
  json["classes"] = classes_json(map.classes);
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

/// "name: value" lines, nested ones indented.
void print_lines(const Json& json, const std::string& indent) {
  for (const auto& [key, value] : json.items()) {
    if (value.is_object()) {
      std::printf("%s%s:\n", indent.c_str(), key.c_str());
      print_lines(value, indent + "  ");
    } else {
      std::printf("%s%s: %s\n", indent.c_str(), key.c_str(),
                  value.is_string() ? value.get<std::string>().c_str() : value.dump().c_str());
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

int run(const fs::path& path, const ReadingArguments& reading, bool with_grids, const fs::path& pictures,
        const CommonOptions& common) {
  if (!fs::exists(path))
    throw IoError(describe_mismatch(path.string(), "what to describe", "a map file or a sequence", "nothing there"));
  // Sequences are folders, but for containers and single scans.
  const bool is_map = fs::is_regular_file(path) && path.extension() != ".sens" && path.extension() != ".bin";
  if (is_map && !pictures.empty())
    throw ConfigError(describe_mismatch("--pictures", "what to describe", "a sequence", path.string()));
  const SequenceOptions options = resolve(reading);
  const Json json = is_map ? describe_map(path, with_grids) : describe_sequence(path, options);
  if (!pictures.empty()) write_pictures(path, options, pictures);
  if (common.json) {
    print_json(json);
  } else {
    print_lines(json, "");
  }
  return kDone;
}

}  // namespace

void add_info(CLI::App& app) {
  struct Arguments {
    fs::path path;
    ReadingArguments reading;
    fs::path pictures;
    bool grids = false;
    CommonOptions common;
  };
  auto a = std::make_shared<Arguments>();
  CLI::App& command =
      add_command(app,
                  {"info", "Say what a map or a sequence holds",
                   "feltmap info result/map.vdb\nfeltmap info recording --json --pictures looks"},
                  a->common, [a] { return run(a->path, a->reading, a->grids, a->pictures, a->common); });
  command.add_option("PATH", a->path, "A map file, or a folder (or .sens file) of a recorded sequence")->required();
  command.add_flag("--grids", a->grids, "Of a map also every grid: active voxels, least, greatest and mean value");
  command.add_option("--pictures", a->pictures, "Folder for thumbnails.png and trajectory.png of a sequence");
  add_reading_options(command, a->reading);
}

}  // namespace felt::apps
