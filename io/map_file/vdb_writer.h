#pragma once

#include <openvdb/MetaMap.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "mapping/grids/leaf_grid.h"

namespace felt {

class MapTrailer;

/// How a file stores values; every stock reader that is built with the library named reads them.
enum class VdbCodec {
  none,   ///< values of active voxels as they are
  blosc,  ///< LZ4 with byte shuffling
  zip     ///< DEFLATE
};

/// Writes an OpenVDB file (version 224, with grid offsets) that appears whole or not at all, from descriptions of grids
/// and without their trees. Memory: a leaf for each thread, 64 bytes for each leaf of a grid, and at most 64 MiB of
/// what is compressed. The bytes follow from the arguments and not from the number of threads: the random identifier of
/// a file is replaced by one that follows from `seed`. Every member throws IoError.
class VdbWriter {
public:
  /// Nothing can be written yet, but a place that cannot be written to shows here. `trailer`, if any, is given every
  /// byte of the file.
  explicit VdbWriter(const std::filesystem::path& path, MapTrailer* trailer = nullptr);
  ~VdbWriter();
  VdbWriter(const VdbWriter&) = delete;
  VdbWriter& operator=(const VdbWriter&) = delete;

  /// `grids`: the number of `write` calls that follow.
  void begin(const openvdb::MetaMap& metadata, size_t grids, const std::string& seed);
  /// Names must be distinct. `in_16_bits`: floats in 16 bits.
  void write(const LeafGrid& grid, VdbCodec codec, bool in_16_bits = false);
  /// Appends bytes that OpenVDB does not read, and puts the file in its place.
  void commit(const std::string& tail = "");

private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace felt
