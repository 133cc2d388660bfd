#include "io/sequence/sequence_fingerprint.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

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

/// Whether there was one to add.
bool add_image(ContentHash& hash, const ImageSource& image) {
  constexpr size_t kLimitBytes = size_t(1) << 26;
  if (image.codec != ImageSource::Codec::image_file || stored_bytes(image) == 0) return false;
  try {
    hash.add(read_whole_file(image.path, kLimitBytes));
  } catch (const Error&) {
    return false;  // of a frame that will be skipped as well
  }
  return true;
}

void add_first_image(ContentHash& hash, std::span<const FrameRecord> frames) {
  for (const FrameRecord& frame : frames)
    if (add_image(hash, frame.depth)) return;
}

/// Every image of a frame that says what is where.
std::vector<ImageSource> label_images(const FrameRecord& frame) {
  std::vector<ImageSource> images{frame.labels, frame.probabilities, frame.instances};
  images.insert(images.end(), frame.masks.begin(), frame.masks.end());
  for (const ClassMap& map : frame.class_maps) images.push_back(map.image);
  return images;
}

std::string label_content(const SequenceListing& listing) {
  constexpr int kRead = 16;
  ContentHash hash;
  int read = 0;
  for (const FrameRecord& frame : listing.frames) {
    for (const ImageSource& image : label_images(frame)) {
      add(hash, stored_bytes(image));
      if (read < kRead) read += add_image(hash, image);
    }
    for (const ClassMap& map : frame.class_maps) add(hash, map.class_id), add(hash, map.score);
  }
  return hash.digits();
}

std::string numbers_text(const nlohmann::json& numbers) { return numbers.dump(); }

template <typename Matrix>
std::string matrix_text(const Matrix& matrix) {
  nlohmann::json numbers = nlohmann::json::array();
  for (int row = 0; row < 4; ++row)
    for (int column = 0; column < 4; ++column) numbers.push_back(matrix(row, column));
  return numbers_text(numbers);
}

std::string lens_text(const Distortion& d) { return numbers_text({d.k1, d.k2, d.p1, d.p2, d.k3}); }

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

std::map<std::string, std::string> reading_text(const SequenceListing& listing, const PinholeCamera& camera) {
  std::map<std::string, std::string> text = {
      {"camera", numbers_text({camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height})},
      {"lens", lens_text(listing.distortion)},
      {"depth scale", numbers_text(listing.depth_scale)},
      {"depth encoding", to_string(listing.depth_encoding)},
      {"depth along rays", listing.depth_is_ray_length ? "yes" : "no"},
      {"pose convention", to_string(listing.pose_convention)},
      {"T_body_camera", matrix_text(listing.T_body_camera.matrix())},
      {"label images", label_content(listing)}};
  if (const auto& k = listing.color_intrinsics) {
    text["colour camera"] = numbers_text({k->fx, k->fy, k->cx, k->cy, listing.color_width, listing.color_height});
    text["lens of the colour camera"] = lens_text(listing.color_distortion);
    text["T_color_depth"] = matrix_text(listing.T_color_depth);
  }
  return text;
}

}  // namespace felt
