#include "io/vdb_file.h"

#include <cerrno>
#include <cstring>

#include "core/error.h"

namespace felt {
namespace {

constexpr size_t kBufferBytes = 1 << 20;

uint32_t flags_of(MapCompression compression, bool noisy) {
  if (compression == MapCompression::fast) compression = noisy ? MapCompression::none : MapCompression::blosc;
  const uint32_t codec = compression == MapCompression::blosc ? openvdb::io::COMPRESS_BLOSC
                         : compression == MapCompression::zip ? openvdb::io::COMPRESS_ZIP
                                                              : openvdb::io::COMPRESS_NONE;
  return openvdb::io::COMPRESS_ACTIVE_MASK | codec;
}

std::ofstream opened(const std::filesystem::path& path, std::vector<char>& buffer) {
  std::ofstream stream;
  stream.rdbuf()->pubsetbuf(buffer.data(), std::streamsize(buffer.size()));
  stream.open(path, std::ios::binary | std::ios::in | std::ios::out);
  return stream;
}

}  // namespace

VdbFile::VdbFile(const std::filesystem::path& path)
    : shown_(path), file_(path), buffer_(kBufferBytes), stream_(opened(file_.path(), buffer_)) {
  check();
}

void VdbFile::begin(const openvdb::MetaMap& metadata, size_t grids, const std::string& seed) {
  writer_.emplace(stream_, metadata, int32_t(grids), seed);
  check();
}

void VdbFile::check() {
  if (!stream_.good()) throw IoError(shown_.string() + ": cannot write: " + std::strerror(errno));
}

void VdbFile::write(openvdb::GridBase& grid, MapCompression compression, bool noisy) {
  writer_->write(grid, flags_of(compression, noisy));
  // A full disk shows here, not after the remaining grids.
  check();
}

void VdbFile::flush() {
  stream_.flush();
  check();
}

void VdbFile::commit(const std::string& trailer) {
  stream_.write(trailer.data(), std::streamsize(trailer.size()));
  flush();
  file_.commit();
}

}  // namespace felt
