#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "mapping/grids/leaf_grid.h"

namespace felt {

/// The grids of a map file in the order in which the file holds them (docs/file_format.md): what a map is loaded from,
/// then what follows from it. `map` must outlive the result and stay as it is. Their values are made when they are
/// asked for, so that the file's size does not decide about memory.
std::vector<LeafGrid> state_grids(const Map& map);
std::vector<LeafGrid> view_grids(const Map& map);
std::vector<LeafGrid> map_grids(const Map& map);  ///< both

/// Which grids of a map to write for viewing, and how.
struct VdbExport {
  std::vector<std::string> grids;  ///< names, or beginnings that end in '/' ("evidence/"); empty: every grid
  bool half = false;               ///< store floats in 16 bits
  const Region* part = nullptr;    ///< only what lies in these voxels; null: everything
};

/// Writes chosen grids as an OpenVDB file that any program reads. It is no map file: it has no checksum and, with
/// chosen grids or 16 bits, not all of the state. Returns the names written. Throws ConfigError for a name that no grid
/// has (with those there are) and IoError.
std::vector<std::string> export_vdb(const Map& map, const std::filesystem::path& path, const VdbExport& options);

}  // namespace felt
