#pragma once

#include <openvdb/MetaMap.h>

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt {

/// What a map file's metadata says (docs/file_format.md names the keys).
struct MapHeader {
  double voxel_size_m = 0;
  double truncation_m = 0;
  std::string hash;  ///< `map_hash` of what was saved
  ClassTable classes;
  PropertyTable properties;
  FrameJournal frames;
  TouchJournal touches;  ///< without region masks
  std::map<std::string, std::string> metadata;
};

/// Frame numbers as a file states them, [first, step, count]: a recording that was fused whole is one triple.
std::vector<std::array<int64_t, 3>> frame_runs(const std::vector<int64_t>& frames);

openvdb::MetaMap to_metadata(const Map& map, const std::string& hash);

/// Throws FormatError naming `where` and the key that is absent or wrong.
MapHeader read_metadata(const openvdb::MetaMap& metadata, const std::string& where);

}  // namespace felt
