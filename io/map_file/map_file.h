#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "mapping/map.h"
#include "mapping/maps/map_verify.h"

namespace felt {

/// The map file: one OpenVDB file of stock grids, followed by a trailer with a checksum that stock readers do not look
/// at. docs/file_format.md describes every grid and every key.
inline constexpr uint32_t kMapFileVersion = 1;

/// How leaf values are stored. All are exact; every stock reader built with the library named reads them.
enum class MapCompression {
  fast,   ///< blosc for counts; distances, weights and colours as they are: noise that blosc hardly shortens
  none,   ///< values of active voxels as they are
  blosc,  ///< LZ4 with byte shuffling
  zip     ///< DEFLATE: small and slow
};

struct SaveOptions {
  MapCompression compression = MapCompression::fast;
  bool views = true;  ///< also what stock viewers show and loading does not need: labels, entropy, property estimates
};

/// Writes the map so that `path` holds either what it held before or the whole new map, also through a crash or a full
/// disk. Memory: less than 100 MiB and a thirtieth of the planes, whatever the map. The same map gives the same bytes.
/// Returns the map's hash (`map_hash`), which the file holds. Throws IoError.
std::string save_map(const Map& map, const std::filesystem::path& path, const SaveOptions& options = {});

/// Reads a map whose `map_hash` is that of the map that was saved, and which goes on as that one would have. The
/// checksum is verified before any of the content is interpreted. Throws IoError where the file cannot be read and
/// FormatError, with the reason, where it is no map file, has an unknown version, or was changed in any byte.
Map load_map(const std::filesystem::path& path);

/// A map file looked at as a whole.
struct ExaminedMap {
  Map map;
  std::vector<MapFault> faults;  ///< of the map (`verify`), and of the views that its file holds
  size_t views = 0;              ///< how many views the file holds
};

/// Loads a map, checks every invariant of it, and makes every view of its file anew to compare. Throws as `load_map`
/// does.
ExaminedMap examine_map(const std::filesystem::path& path);

}  // namespace felt
