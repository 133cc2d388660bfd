#include "io/sequence/sequence_fingerprint.h"

#include <algorithm>
#include <span>

#include "core/error.h"
#include "io/files/content_hash.h"
#include "io/files/text_input.h"

namespace felt {
namespace {

template <typename Number>
void add(ContentHash& hash, const Number& number) {
  hash.add({reinterpret_cast<const char*>(&number), sizeof number});
}

void add_place(ContentHash& hash, const FrameRecord& frame) {
  add(hash, frame.index);
  add(hash, frame.stamp_s);
  if (frame.pose) add(hash, frame.pose->matrix());
}

void add_sizes(ContentHash& hash, const FrameRecord& frame) {
  add(hash, stored_bytes(frame.depth));
  add(hash, stored_bytes(frame.color));
}

void add_first_image(ContentHash& hash, std::span<const FrameRecord> frames) {
  constexpr size_t kLimitBytes = size_t(1) << 26;
  for (const FrameRecord& frame : frames) {
    if (frame.depth.codec != ImageSource::Codec::image_file || stored_bytes(frame.depth) == 0) continue;
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
  constexpr size_t kFrames = 8, kDigits = 16;
  const auto frames = std::span(listing.frames).first(std::min(kFrames, listing.frames.size()));
  ContentHash images, places;
  for (const FrameRecord& frame : frames) {
    add_sizes(images, frame);
    add_place(places, frame);
  }
  add_first_image(images, frames);
  return images.digits().substr(0, kDigits) + places.digits().substr(0, kDigits);
}

std::string frames_content(const SequenceListing& listing) {
  ContentHash hash;
  for (const FrameRecord& frame : listing.frames) {
    add_place(hash, frame);
    add_sizes(hash, frame);
  }
  add_first_image(hash, listing.frames);
  return hash.digits();
}

}  // namespace felt
