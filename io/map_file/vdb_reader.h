#pragma once

#include <openvdb/MetaMap.h>
#include <openvdb/Types.h>

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "io/files/opened_file.h"
#include "mapping/store/region.h"

namespace felt {

/// One grid of an OpenVDB file.
struct VdbGridEntry {
  std::string name, type;         ///< type as OpenVDB names it: "Tree_float_5_4_3"
  uint32_t compression = 0;       ///< openvdb::io's flags
  uint64_t tree_at = 0, end = 0;  ///< bytes of the file: where its tree begins, where the grid ends
  /// Numbers of its UniformScaleMap, three of each: scale, edge of a voxel, 1 / scale, 1 / scale^2, 1 / (2 scale).
  std::array<double, 15> transform{};
};

/// A leaf as the file holds it. `values`: 512, valid during the call.
template <typename Value>
struct VdbLeaf {
  BlockCoord coord;
  BlockMask active;
  const Value* values = nullptr;
};

/// Reads OpenVDB files as VdbWriter writes them (file version 224, trees 5-4-3, leaves only, no active tiles) leaf by
/// leaf, and trusts nothing in them: every length is checked against what is left of the file before memory is taken
/// for it. OpenVDB's own reader is made for files of friends: a count in the wrong place makes it loop or allocate
/// without end. Every member throws FormatError, with the place, for what it does not read, and IoError.
class VdbReader {
public:
  /// Reads the header and the list of grids in the first `bytes` bytes of a file, which must outlive the reader.
  VdbReader(const OpenedFile& file, uint64_t bytes, std::string where);

  /// Entries of type int32, double and string.
  const openvdb::MetaMap& metadata() const { return metadata_; }
  const std::vector<VdbGridEntry>& grids() const { return grids_; }
  bool has(const std::string& name) const;
  /// The grid of that name. Throws where there is none, or one of another type.
  const VdbGridEntry& grid(const std::string& name, const std::string& type) const;
  /// Throws unless every grid places its voxels by `index * voxel_size_m`.
  void require_voxel_size(double voxel_size_m) const;

  /// Calls `visit` for each leaf of a grid of float, int32_t or openvdb::Vec3s, in the order of the file. No coordinate
  /// comes twice. Returns the grid's background.
  template <typename Value>
  Value read(const std::string& name, const std::function<void(const VdbLeaf<Value>&)>& visit) const;
  /// Voxels of a mask grid.
  Region read_mask(const std::string& name) const;

private:
  const OpenedFile& file_;
  std::string where_;
  openvdb::MetaMap metadata_;
  std::vector<VdbGridEntry> grids_;
};

}  // namespace felt
