#include "io/map_trailer.h"

#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "io/opened_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

static_assert(std::endian::native == std::endian::little, "OpenVDB writes native integers; so does the trailer");

constexpr char kMagic[] = "feltmap trailer\n";  // 16 characters
constexpr size_t kDigestBytes = sizeof(XXH128_canonical_t), kHeadBytes = kMapTrailerBytes - kDigestBytes;
static_assert(sizeof kMagic - 1 == 16);

/// Digest of the first `bytes` of the file followed by `tail`.
XXH128_canonical_t digest(const OpenedFile& file, uint64_t bytes, const char* tail, size_t tail_bytes) {
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), &XXH3_freeState);
  XXH3_128bits_reset(state.get());
  std::vector<char> buffer(1 << 20);
  for (uint64_t at = 0; at < bytes;) {
    const size_t n = size_t(std::min<uint64_t>(buffer.size(), bytes - at));
    file.read(buffer.data(), n, at);
    XXH3_128bits_update(state.get(), buffer.data(), n);
    at += n;
  }
  XXH3_128bits_update(state.get(), tail, tail_bytes);
  XXH128_canonical_t result;
  XXH128_canonicalFromHash(&result, XXH3_128bits_digest(state.get()));
  return result;
}

}  // namespace

std::string make_map_trailer(const fs::path& path, uint32_t version) {
  const OpenedFile file(path);
  const uint64_t payload = file.size();
  const uint32_t zero = 0;
  std::string trailer(kMagic, 16);
  trailer.append(reinterpret_cast<const char*>(&version), sizeof version);
  trailer.append(reinterpret_cast<const char*>(&zero), sizeof zero);
  trailer.append(reinterpret_cast<const char*>(&payload), sizeof payload);
  const XXH128_canonical_t sum = digest(file, payload, trailer.data(), trailer.size());
  trailer.append(reinterpret_cast<const char*>(sum.digest), kDigestBytes);
  return trailer;
}

uint64_t verify_map_trailer(const fs::path& path, uint32_t known_version) {
  const OpenedFile file(path);
  const std::string where = path.string();
  if (file.size() < kMapTrailerBytes)
    throw FormatError(
        describe_mismatch(where, "size", "a map file of more than 48 bytes", std::to_string(file.size()) + " bytes"));
  char trailer[kMapTrailerBytes];
  const uint64_t payload = file.size() - kMapTrailerBytes;
  file.read(trailer, sizeof trailer, payload);
  if (std::memcmp(trailer, kMagic, 16) != 0)
    throw FormatError(describe_mismatch(where, "end of file", "the trailer of a feltmap map",
                                        "none (cut short, or written by another program)"));
  uint32_t version;
  std::memcpy(&version, trailer + 16, sizeof version);
  if (version != known_version)
    throw FormatError(
        describe_mismatch(where, "format version", std::to_string(known_version), std::to_string(version)));
  uint64_t stated;
  std::memcpy(&stated, trailer + 24, sizeof stated);
  if (stated != payload)
    throw FormatError(describe_mismatch(where, "size", std::to_string(stated) + " bytes before the trailer",
                                        std::to_string(payload)));
  const XXH128_canonical_t sum = digest(file, payload, trailer, kHeadBytes);
  if (std::memcmp(sum.digest, trailer + kHeadBytes, kDigestBytes) != 0)
    throw FormatError(describe_mismatch(where, "checksum", "the one in the trailer",
                                        "another: the file was changed or damaged after it was written"));
  return payload;
}

}  // namespace felt
