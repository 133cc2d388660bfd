#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace felt {

class OpenedFile;

/// The end of a map file, after OpenVDB's own data: magic (16 bytes), format version (u32), zero (u32), bytes before
/// the trailer (u64), and XXH3-128 of everything before it (16 bytes, canonical order). Integers are little-endian.
inline constexpr size_t kMapTrailerBytes = 48;

/// Gathers the checksum while a map file is written.
class MapTrailer {
public:
  MapTrailer();
  ~MapTrailer();
  MapTrailer(const MapTrailer&) = delete;
  MapTrailer& operator=(const MapTrailer&) = delete;

  /// The next bytes of the file.
  void add(const void* data, size_t bytes);
  /// The trailer to append behind all of them. Once, at the end.
  std::string finish(uint32_t version);

private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Checks magic, version, length and checksum; returns the number of bytes before the trailer. Nothing of the content
/// is interpreted. Throws IoError and FormatError, the latter with the first thing that is wrong.
uint64_t verify_map_trailer(const OpenedFile& file, const std::string& where, uint32_t known_version);

}  // namespace felt
