#include "io/vdb_writer.h"

#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/io/io.h>
#include <xxhash.h>

#include <ostream>

namespace felt {
namespace {

/// 128 bits as 8-4-4-4-12 hex digits, the form of OpenVDB's file identifier.
std::string identifier(const std::string& seed) {
  const XXH128_hash_t h = XXH3_128bits(seed.data(), seed.size());
  char text[37];
  snprintf(text, sizeof text, "%08x-%04x-%04x-%04x-%012llx", unsigned(h.high64 >> 32),
           unsigned(h.high64 >> 16 & 0xffff), unsigned(h.high64 & 0xffff), unsigned(h.low64 >> 48),
           static_cast<unsigned long long>(h.low64 << 16 >> 16));
  return text;
}

}  // namespace

VdbWriter::VdbWriter(std::ostream& os, const openvdb::MetaMap& metadata, int32_t grids, const std::string& seed)
    : os_(os) {
  stream_metadata_->setSeekable(true);
  openvdb::io::setStreamMetadataPtr(os_, stream_metadata_, /*transfer=*/false);
  writeHeader(os_, /*seekable=*/true);
  // The header ends with the identifier as text.
  const std::string id = identifier(seed);
  os_.seekp(-std::streamoff(id.size()), std::ios::cur);
  os_.write(id.data(), std::streamsize(id.size()));
  metadata.writeMeta(os_);
  os_.write(reinterpret_cast<const char*>(&grids), sizeof grids);
}

VdbWriter::~VdbWriter() { openvdb::io::clearStreamMetadataPtr(os_); }

void VdbWriter::write(openvdb::GridBase& grid, uint32_t compression) {
  setCompression(compression);
  openvdb::io::GridDescriptor descriptor(grid.getName(), grid.type(), grid.saveFloatAsHalf());
  descriptor.writeHeader(os_);
  const std::streampos offsets = os_.tellp();
  descriptor.writeStreamPos(os_);
  descriptor.setGridPos(os_.tellp());
  setGridCompression(os_, grid);
  // Archive::writeGrid would compress every leaf twice, the first time for a table that speeds up delayed loading.
  grid.addStatsMetadata();
  grid.writeMeta(os_);
  grid.writeTransform(os_);
  grid.writeTopology(os_);
  descriptor.setBlockPos(os_.tellp());
  grid.writeBuffers(os_);
  descriptor.setEndPos(os_.tellp());
  os_.seekp(offsets);
  descriptor.writeStreamPos(os_);
  descriptor.seekToEnd(os_);
}

}  // namespace felt
