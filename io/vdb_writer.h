#pragma once

#include <openvdb/io/Archive.h>
#include <openvdb/io/io.h>
#include <openvdb/openvdb.h>

#include <iosfwd>
#include <string>

namespace felt {

/// Writes an OpenVDB file grid by grid, so that no more than one grid needs to be in memory: io::File and io::Stream
/// take all of them at once. The result has grid offsets like that of io::File. Same grids, same bytes: the random
/// identifier that OpenVDB puts into a file's header is replaced by one that follows from `seed`.
class VdbWriter : private openvdb::io::Archive {
public:
  /// `os` is seekable and at its beginning. `grids` is the number of `write` calls that follow.
  VdbWriter(std::ostream& os, const openvdb::MetaMap& metadata, int32_t grids, const std::string& seed);
  ~VdbWriter() override;
  VdbWriter(const VdbWriter&) = delete;
  VdbWriter& operator=(const VdbWriter&) = delete;

  /// `compression` is a combination of openvdb::io's flags. Grid names must be distinct. Float grids with
  /// `saveFloatAsHalf` are stored in 16 bits. Adds the usual statistics (file_bbox_min, file_voxel_count, ...) to the
  /// grid's metadata.
  void write(openvdb::GridBase& grid, uint32_t compression);

private:
  std::ostream& os_;
  /// The stream refers to this object, not to what it points at: it has to live as long as the writer.
  openvdb::io::StreamMetadata::Ptr stream_metadata_ = std::make_shared<openvdb::io::StreamMetadata>();
};

}  // namespace felt
