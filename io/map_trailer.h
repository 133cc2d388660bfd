#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace felt {

/// The end of a map file, after OpenVDB's own data: magic (16 bytes), format version (u32), zero (u32), bytes before
/// the trailer (u64), and XXH3-128 of everything before it (16 bytes, canonical order). Integers are little-endian.
inline constexpr size_t kMapTrailerBytes = 48;

/// Hashes what was written to `path` so far and returns the trailer to append. Throws IoError.
std::string make_map_trailer(const std::filesystem::path& path, uint32_t version);

/// Checks magic, version, length and checksum; returns the number of bytes before the trailer. Nothing of the content
/// is interpreted. Throws IoError and FormatError, the latter with the first thing that is wrong.
uint64_t verify_map_trailer(const std::filesystem::path& path, uint32_t known_version);

}  // namespace felt
