#include "io/map_file/map_metadata.h"

#include <openvdb/openvdb.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "core/error.h"
#include "io/files/json_number.h"
#include "io/map_file/map_file.h"
#include "io/readings/touch_json.h"
#include "io/tables/property_yaml.h"

namespace felt {
namespace {

using nlohmann::json;

constexpr const char* kFormat = "feltmap_format";
constexpr const char* kVoxelSize = "voxel_size_m";
constexpr const char* kTruncation = "truncation_m";
constexpr const char* kHash = "map_hash";
constexpr const char* kClasses = "class_table";
constexpr const char* kFrames = "frame_journal";
constexpr const char* kProperties = "property_table";
constexpr const char* kTouches = "touch_journal";
constexpr const char* kCentre = "voxel_centre";
constexpr const char* kCentreRule = "index (i, j, k) is the voxel's centre, at (i, j, k) * voxel_size_m";
const std::string kTextPrefix = "text/";

json classes_to_json(const ClassTable& table) {
  json rows = json::array();
  for (const ClassInfo& c : table.classes()) {
    rows.push_back(
        {{"id", c.id}, {"name", c.name}, {"color", {c.color.r, c.color.g, c.color.b}}, {"ignore", c.ignore}});
    // Always a number, never "the default": what a map believes must not change with a default. None in a file is 1.
    const double prior = c.prior.value_or(ClassTable::default_prior(table.size()));
    if (prior != 1) rows.back()["prior"] = prior;
  }
  return rows;
}

ClassTable classes_from_json(const json& rows) {
  std::vector<ClassInfo> classes;
  for (const json& row : rows) {
    const json& color = row.at("color");
    classes.push_back(
        {whole_number<uint16_t>(row.at("id")),
         row.at("name").get<std::string>(),
         {whole_number<uint8_t>(color.at(0)), whole_number<uint8_t>(color.at(1)), whole_number<uint8_t>(color.at(2))},
         row.at("ignore").get<bool>(),
         row.value("prior", 1.0)});
  }
  return classes.empty() ? ClassTable() : ClassTable(std::move(classes));
}

/// A count in a file takes memory that the file's size does not justify: 80 MB at most. 92 hours at 30 frames a second.
constexpr int64_t kMostFrames = 10'000'000;

/// `left`: how many more frames the whole journal may name.
std::vector<int64_t> frames_from_json(const json& triples, int64_t& left) {
  const auto number = [](const json& triple, size_t i) { return whole_number<int64_t>(triple.at(i)); };
  const int64_t before = left;
  for (const json& triple : triples) {
    const int64_t count = number(triple, 2);
    if (count < 0 || count > left) throw FormatError("more than " + std::to_string(kMostFrames) + " frames");
    left -= count;
  }
  std::vector<int64_t> frames;
  frames.reserve(size_t(before - left));
  for (const json& triple : triples) {
    // Numbers may be stamps in nanoseconds.
    const int64_t first = number(triple, 0), step = number(triple, 1), count = number(triple, 2);
    int64_t way = 0, last = 0;
    if (count > 0 && (__builtin_mul_overflow(count - 1, step, &way) || __builtin_add_overflow(first, way, &last)))
      throw FormatError("frame numbers out of range");
    for (int64_t i = 0; i < count; ++i) frames.push_back(first + i * step);
  }
  return frames;
}

json journal_to_json(const FrameJournal& journal) {
  json runs = json::array();
  for (const FusedFrames& run : journal.runs)
    runs.push_back({{"sequence", run.sequence}, {"settings", run.settings}, {"frames", frame_runs(run.frames)}});
  return runs;
}

FrameJournal journal_from_json(const json& runs) {
  FrameJournal journal;
  int64_t left = kMostFrames;
  for (const json& run : runs)
    journal.runs.push_back({run.at("sequence").get<std::string>(), run.at("settings").get<std::string>(),
                            frames_from_json(run.at("frames"), left)});
  return journal;
}

template <typename T>
T value(const openvdb::MetaMap& metadata, const char* key, const std::string& where) {
  const openvdb::Metadata::ConstPtr found = metadata[key];
  if (found == nullptr) throw FormatError(describe_mismatch(where, "file metadata", std::string("key ") + key, "none"));
  const auto* typed = dynamic_cast<const openvdb::TypedMetadata<T>*>(found.get());
  if (typed == nullptr)
    throw FormatError(
        describe_mismatch(where, key, openvdb::TypedMetadata<T>().typeName() + " metadata", found->typeName()));
  return typed->value();
}

double positive(const openvdb::MetaMap& metadata, const char* key, const std::string& where) {
  const auto number = value<double>(metadata, key, where);
  if (!(number > 0) || !std::isfinite(number))
    throw FormatError(describe_mismatch(where, key, "a positive number", std::to_string(number)));
  return number;
}

template <typename Read>
auto parsed(const openvdb::MetaMap& metadata, const char* key, const std::string& where, Read read) {
  const auto text = value<std::string>(metadata, key, where);
  try {
    return read(json::parse(text));
  } catch (const std::exception& error) {
    throw FormatError(describe_mismatch(where, key, "the JSON that docs/file_format.md describes", error.what()));
  }
}

}  // namespace

std::vector<std::array<int64_t, 3>> frame_runs(const std::vector<int64_t>& frames) {
  std::vector<std::array<int64_t, 3>> triples;
  for (size_t i = 0; i < frames.size();) {
    size_t end = i + 1;
    const int64_t step = end < frames.size() ? frames[end] - frames[i] : 1;
    while (end < frames.size() && frames[end] - frames[end - 1] == step) ++end;
    triples.push_back({frames[i], step, int64_t(end - i)});
    i = end;
  }
  return triples;
}

openvdb::MetaMap to_metadata(const Map& map, const std::string& hash) {
  if (frame_count(map.frames) > size_t(kMostFrames))
    throw FormatError(describe_mismatch("map", "frames in the journal", "at most " + std::to_string(kMostFrames),
                                        std::to_string(frame_count(map.frames))));
  openvdb::MetaMap metadata;
  metadata.insertMeta(kFormat, openvdb::Int32Metadata(int32_t(kMapFileVersion)));
  metadata.insertMeta("creator", openvdb::StringMetadata("feltmap"));
  metadata.insertMeta(kCentre, openvdb::StringMetadata(kCentreRule));
  metadata.insertMeta(kVoxelSize, openvdb::DoubleMetadata(map.voxel_size_m));
  metadata.insertMeta(kTruncation, openvdb::DoubleMetadata(map.truncation_m));
  metadata.insertMeta(kHash, openvdb::StringMetadata(hash));
  try {
    metadata.insertMeta(kClasses, openvdb::StringMetadata(classes_to_json(map.classes).dump()));
    metadata.insertMeta(kFrames, openvdb::StringMetadata(journal_to_json(map.frames).dump()));
    if (!map.properties.empty())
      metadata.insertMeta(kProperties, openvdb::StringMetadata(properties_yaml(map.properties)));
    if (!map.touches.touches.empty())
      metadata.insertMeta(kTouches, openvdb::StringMetadata(touch_journal_json(map.touches)));
  } catch (const json::exception& error) {
    throw FormatError(describe_mismatch("map", "names in the frame journal", "UTF-8", error.what()));
  }
  for (const auto& [key, text] : map.metadata) metadata.insertMeta(kTextPrefix + key, openvdb::StringMetadata(text));
  return metadata;
}

MapHeader read_metadata(const openvdb::MetaMap& metadata, const std::string& where) try {
  MapHeader header;
  if (const auto version = value<int32_t>(metadata, kFormat, where); version != int32_t(kMapFileVersion))
    throw FormatError(
        describe_mismatch(where, "format version", std::to_string(kMapFileVersion), std::to_string(version)));
  header.voxel_size_m = positive(metadata, kVoxelSize, where);
  header.truncation_m = positive(metadata, kTruncation, where);
  header.hash = value<std::string>(metadata, kHash, where);
  header.classes = parsed(metadata, kClasses, where, classes_from_json);
  header.frames = parsed(metadata, kFrames, where, journal_from_json);
  if (metadata[kProperties] != nullptr)
    header.properties = parse_properties(value<std::string>(metadata, kProperties, where), where + ": property_table");
  if (metadata[kTouches] != nullptr)
    header.touches = parse_touch_journal(value<std::string>(metadata, kTouches, where), where);
  for (auto entry = metadata.beginMeta(); entry != metadata.endMeta(); ++entry)
    if (entry->first.starts_with(kTextPrefix))
      header.metadata[entry->first.substr(kTextPrefix.size())] =
          value<std::string>(metadata, entry->first.c_str(), where);
  return header;
} catch (const ConfigError& fault) {
  // What the parser of a file of settings refuses is, within a map, damage.
  throw FormatError(fault.what());
}

}  // namespace felt
