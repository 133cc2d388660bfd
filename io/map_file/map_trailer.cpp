#include "io/map_file/map_trailer.h"

#include <xxhash.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "io/files/opened_file.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

static_assert(std::endian::native == std::endian::little, "OpenVDB writes native integers; so does the trailer");

constexpr char kMagic[] = "feltmap trailer\n";  // 16 characters
constexpr size_t kDigestBytes = sizeof(XXH128_canonical_t);
static_assert(sizeof kMagic - 1 == 16);

}  // namespace

struct MapTrailer::State {
  State() {
    if (hash == nullptr) throw std::bad_alloc();
    XXH3_128bits_reset(hash.get());
  }
  XXH128_canonical_t digest() const {
    XXH128_canonical_t result;
    XXH128_canonicalFromHash(&result, XXH3_128bits_digest(hash.get()));
    return result;
  }

  std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> hash{XXH3_createState(), &XXH3_freeState};
  uint64_t bytes = 0;
};

MapTrailer::MapTrailer() : state_(std::make_unique<State>()) {}
MapTrailer::~MapTrailer() = default;

void MapTrailer::add(const void* data, size_t bytes) {
  XXH3_128bits_update(state_->hash.get(), data, bytes);
  state_->bytes += bytes;
}

std::string MapTrailer::finish(uint32_t version) {
  const uint64_t payload = state_->bytes;
  const uint32_t zero = 0;
  std::string trailer(kMagic, 16);
  trailer.append(reinterpret_cast<const char*>(&version), sizeof version);
  trailer.append(reinterpret_cast<const char*>(&zero), sizeof zero);
  trailer.append(reinterpret_cast<const char*>(&payload), sizeof payload);
  add(trailer.data(), trailer.size());
  const XXH128_canonical_t sum = state_->digest();
  trailer.append(reinterpret_cast<const char*>(sum.digest), kDigestBytes);
  return trailer;
}

uint64_t verify_map_trailer(const OpenedFile& file, const std::string& where, uint32_t known_version) {
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
  MapTrailer found;
  std::vector<char> buffer(size_t(std::min<uint64_t>(payload, 1 << 20)));
  for (uint64_t at = 0; at < payload;) {
    const size_t n = size_t(std::min<uint64_t>(buffer.size(), payload - at));
    file.read(buffer.data(), n, at);
    found.add(buffer.data(), n);
    at += n;
  }
  if (found.finish(version) != std::string_view(trailer, sizeof trailer))
    throw FormatError(describe_mismatch(where, "checksum", "the one in the trailer",
                                        "another: the file was changed or damaged after it was written"));
  return payload;
}

}  // namespace felt
