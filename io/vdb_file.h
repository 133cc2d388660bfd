#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "io/atomic_file.h"
#include "io/map_file.h"
#include "io/vdb_writer.h"

namespace felt {

/// An OpenVDB file that appears whole or not at all, written grid by grid. Every member throws IoError.
class VdbFile {
public:
  /// `grids`: the number of `write` calls that follow. Same grids and `seed`, same bytes.
  VdbFile(const std::filesystem::path& path, const openvdb::MetaMap& metadata, size_t grids, const std::string& seed);
  /// `noisy`: what `MapCompression::fast` leaves as it is.
  void write(openvdb::GridBase& grid, MapCompression compression, bool noisy);
  /// Ends the OpenVDB part, so that `written` holds all of it.
  void flush();
  const std::filesystem::path& written() const { return file_.path(); }
  /// Appends bytes that OpenVDB does not read, and puts the file in its place.
  void commit(const std::string& trailer);

private:
  void check();

  std::filesystem::path shown_;
  AtomicFile file_;
  std::vector<char> buffer_;
  std::ofstream stream_;
  VdbWriter writer_;
};

}  // namespace felt
