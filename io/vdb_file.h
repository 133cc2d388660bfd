#pragma once

#include <openvdb/openvdb.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

#include "io/atomic_file.h"
#include "io/map_file.h"
#include "io/vdb_writer.h"

namespace felt {

/// An OpenVDB file that appears whole or not at all, written grid by grid. Every member throws IoError.
class VdbFile {
public:
  /// Nothing can be written yet, but a place that cannot be written to shows here.
  explicit VdbFile(const std::filesystem::path& path);
  /// `grids`: the number of `write` calls that follow. Same grids and `seed`, same bytes.
  void begin(const openvdb::MetaMap& metadata, size_t grids, const std::string& seed);
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
  std::optional<VdbWriter> writer_;
};

}  // namespace felt
