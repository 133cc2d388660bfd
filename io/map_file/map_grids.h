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
  bool half = false;               ///< store floats in 16 bits, but for grids that these cannot hold
  const Region* part = nullptr;    ///< only what lies in these voxels; null: everything
};

/// What was written.
struct ExportedGrids {
  std::vector<std::string> names;
  /// Of these, where 16 bits were asked for, grids of which a value would become infinite (beyond 65,504), or all so
  /// small (below 6e-5) that 16 bits round them coarsely or to 0: they keep 32 bits.
  std::vector<std::string> in_32_bits;
};

/// Writes chosen grids as an OpenVDB file that any program reads. It is no map file: it has no checksum and, with
/// chosen grids or 16 bits, not all of the state. Throws ConfigError for a name that no grid has (with those there are)
/// and IoError.
ExportedGrids export_vdb(const Map& map, const std::filesystem::path& path, const VdbExport& options);

}  // namespace felt
