#include "io/sequence/sequence_fingerprint.h"

#include "core/error.h"
#include "io/files/content_hash.h"
#include "io/files/text_input.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

template <typename Number>
void add(ContentHash& hash, const Number& number) {
  hash.add({reinterpret_cast<const char*>(&number), sizeof number});
}

/// 0 where there is no such image.
uint64_t bytes_of(const ImageSource& source) {
  if (source.empty() || source.bytes > 0) return source.bytes;
  std::error_code fault;
  const uintmax_t bytes = fs::file_size(source.path, fault);
  return fault ? 0 : bytes;
}

void add_first_image(ContentHash& hash, const SequenceListing& listing) {
  constexpr size_t kLimitBytes = size_t(1) << 26;
  for (const FrameRecord& frame : listing.frames) {
    if (frame.depth.codec != ImageSource::Codec::image_file || bytes_of(frame.depth) == 0) continue;
    try {
      hash.add(read_whole_file(frame.depth.path, kLimitBytes));
    } catch (const Error&) {
      continue;  // a frame that will be skipped as well
    }
    return;
  }
}

}  // namespace

std::string fingerprint(const SequenceListing& listing) {
  ContentHash hash;
  for (const FrameRecord& frame : listing.frames) {
    add(hash, frame.index);
    add(hash, frame.stamp_s);
    if (frame.pose) add(hash, frame.pose->matrix());
    add(hash, bytes_of(frame.depth));
    add(hash, bytes_of(frame.color));
  }
  add_first_image(hash, listing);
  return hash.digits();
}

}  // namespace felt
