#include "io/sequence/sequence_fingerprint.h"

#include <xxhash.h>

#include <memory>

#include "core/error.h"
#include "io/files/text_input.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

using Hash = std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)>;

template <typename Number>
void add(const Hash& hash, const Number& number) {
  XXH3_128bits_update(hash.get(), &number, sizeof number);
}

/// 0 where there is no such image.
uint64_t bytes_of(const ImageSource& source) {
  if (source.empty() || source.bytes > 0) return source.bytes;
  std::error_code fault;
  const uintmax_t bytes = fs::file_size(source.path, fault);
  return fault ? 0 : bytes;
}

void add_first_image(const Hash& hash, const SequenceListing& listing) {
  constexpr size_t kLimitBytes = size_t(1) << 26;
  for (const FrameRecord& frame : listing.frames) {
    if (frame.depth.codec != ImageSource::Codec::image_file || bytes_of(frame.depth) == 0) continue;
    try {
      const std::string bytes = read_whole_file(frame.depth.path, kLimitBytes);
      XXH3_128bits_update(hash.get(), bytes.data(), bytes.size());
    } catch (const Error&) {
      continue;  // a frame that will be skipped as well
    }
    return;
  }
}

}  // namespace

std::string fingerprint(const SequenceListing& listing) {
  const Hash hash(XXH3_createState(), &XXH3_freeState);
  XXH3_128bits_reset(hash.get());
  for (const FrameRecord& frame : listing.frames) {
    add(hash, frame.index);
    add(hash, frame.stamp_s);
    if (frame.pose) XXH3_128bits_update(hash.get(), frame.pose->data(), sizeof(double) * 16);
    add(hash, bytes_of(frame.depth));
    add(hash, bytes_of(frame.color));
  }
  add_first_image(hash, listing);
  const XXH128_hash_t h = XXH3_128bits_digest(hash.get());
  char hex[33];
  snprintf(hex, sizeof hex, "%016llx%016llx", static_cast<unsigned long long>(h.high64),
           static_cast<unsigned long long>(h.low64));
  return hex;
}

}  // namespace felt
