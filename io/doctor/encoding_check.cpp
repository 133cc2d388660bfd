#include "io/doctor/encoding_check.h"

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/text.h"
#include "io/doctor/sample.h"
#include "io/files/text_input.h"
#include "io/images/image_decode.h"

namespace felt {
namespace {

/// Share of neighbours (side by side, and one above the other) that differ by more than a quarter.
struct Roughness {
  double across = 0, down = 0;
  double wraps = 0;  ///< share of those side by side of which one is near 0 and the other near the largest of 16 bits
};

/// `width`: of the rows that the image's values are taken to form. `full_scale_m`: the largest number of 16 bits.
Roughness roughness_of(const DepthImage& depth, int width, double full_scale_m) {
  Roughness roughness;
  double across = 0, down = 0;
  const int height = int(depth.size()) / width;
  const auto jumps = [](float a, float b) { return std::abs(a - b) > 0.25f * std::min(a, b); };
  for (int v = 0; v + 1 < height; v += 2)
    for (int u = 0; u + 1 < width; u += 2) {
      const float* const here = depth.data() + size_t(v) * width + u;
      if (here[0] > 0 && here[1] > 0) {
        ++across;
        roughness.across += jumps(here[0], here[1]);
        const auto [least, most] = std::minmax(here[0], here[1]);
        roughness.wraps += most > 0.9 * full_scale_m && least < 0.1 * full_scale_m;
      }
      if (here[0] > 0 && here[width] > 0) ++down, roughness.down += jumps(here[0], here[width]);
    }
  roughness.across /= std::max(1.0, across);
  roughness.wraps /= std::max(1.0, across);
  roughness.down /= std::max(1.0, down);
  return roughness;
}

/// Depth of a few frames spread over the sequence.
std::vector<DepthImage> few_depths(const std::filesystem::path& path, const SequenceOptions& options,
                                   const SequenceListing& listing) {
  const auto reader = plain_reader(path, options, listing, Images::depth);
  std::vector<DepthImage> depths;
  const int64_t step = std::max<int64_t>(1, reader->size() / 8);
  for (int64_t i = 0; i < reader->size() && depths.size() < 4; i += step) {
    ReadResult result = reader->read(i);
    if (auto* frame = std::get_if<Frame>(&result)) depths.push_back(std::move(frame->depth_m));
  }
  return depths;
}

Roughness mean_roughness(const std::vector<DepthImage>& depths, bool swapped, double full_scale_m) {
  Roughness mean;
  for (const DepthImage& depth : depths) {
    const Roughness one = roughness_of(depth, swapped ? depth.height() : depth.width(), full_scale_m);
    mean.wraps += one.wraps / double(depths.size());
    mean.across += one.across / double(depths.size());
    mean.down += one.down / double(depths.size());
  }
  return mean;
}

/// Of neighbouring pixels with different numbers, the share whose three lowest bits agree: by chance an eighth.
double share_of_equal_low_bits(const std::vector<DepthImage>& depths, double scale) {
  size_t different = 0, equal = 0;
  for (const DepthImage& depth : depths)
    for (size_t i = 0; i + 1 < depth.size(); i += 2) {
      if (!(depth.data()[i] > 0 && depth.data()[i + 1] > 0)) continue;
      const long here = std::lround(depth.data()[i] * scale), beside = std::lround(depth.data()[i + 1] * scale);
      if (here == beside) continue;
      ++different;
      equal += (here - beside) % 8 == 0;
    }
  return different == 0 ? 0 : double(equal) / double(different);
}

struct Size {
  int width = 0, height = 0;
  std::string text() const { return size_text(width, height); }
};

/// Size of the first depth image whose header can be read; 0 x 0 where there is none, or images are in a container.
Size depth_image_size(const SequenceListing& listing) {
  for (const FrameRecord& frame : listing.frames) {
    if (frame.depth.empty()) continue;
    if (frame.depth.codec != ImageSource::Codec::image_file || frame.depth.bytes > 0) return {};
    try {
      const std::string bytes = read_whole_file(frame.depth.path);
      const ImageHeader header =
          read_image_header({reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()}, frame.depth.path.string());
      return {header.width, header.height};
    } catch (const Error&) {
      continue;  // the next one; a sequence without any is refused where it is opened
    }
  }
  return {};
}

}  // namespace

std::optional<Finding> check_stated_camera(SequenceListing& listing) {
  const Size image = depth_image_size(listing), stated{listing.width, listing.height};
  if (image.width == 0 || !listing.intrinsics) return std::nullopt;
  Finding finding{"image-size", true, 0.98, "", "", ""};
  Intrinsics& k = *listing.intrinsics;
  const auto fits = [&](const Intrinsics& c) {
    return c.cx > 0 && c.cy > 0 && c.cx < image.width && c.cy < image.height;
  };
  if (stated.width > 0 && (stated.width != image.width || stated.height != image.height)) {
    listing.width = listing.height = 0;
    finding.evidence = "the camera is stated for " + stated.text() + ", depth images are " + image.text();
    if (stated.width == image.height && stated.height == image.width) {
      finding.belief = "the camera states width and height exchanged";
      // Was the rest of the camera exchanged too? The centre of the image tells.
      const double as_is = std::hypot(k.cx - image.width / 2.0, k.cy - image.height / 2.0),
                   exchanged = std::hypot(k.cy - image.width / 2.0, k.cx - image.height / 2.0);
      if (exchanged < as_is) k = {k.fy, k.fx, k.cy, k.cx};
    } else {
      finding.belief = "the camera is that of images of another size";
      const double sx = double(image.width) / stated.width, sy = double(image.height) / stated.height;
      k = {k.fx * sx, k.fy * sy, (k.cx + 0.5) * sx - 0.5, (k.cy + 0.5) * sy - 0.5};
    }
    finding.remedy = intrinsics_option(k.fx, k.fy, k.cx, k.cy);
    return finding;
  }
  if (fits(k)) return std::nullopt;
  const Intrinsics exchanged{k.fy, k.fx, k.cy, k.cx};
  if (!fits(exchanged)) return std::nullopt;
  finding.belief = "the camera is that of an image with width and height exchanged";
  finding.evidence = "the principal point " + number_text(k.cx, "%.5g") + ", " + number_text(k.cy, "%.5g") +
                     " lies outside of " + image.text();
  k = exchanged;
  listing.lacking_camera_file.clear();
  finding.remedy = intrinsics_option(k.fx, k.fy, k.cx, k.cy);
  return finding;
}

std::vector<Finding> check_depth_images(const std::filesystem::path& path, const SequenceOptions& options,
                                        SequenceListing& listing) {
  const std::vector<DepthImage> now = few_depths(path, options, listing);
  if (now.empty()) return {};
  const double full_scale_m = 65535 / listing.depth_scale;
  const Roughness as_read = mean_roughness(now, false, full_scale_m), swapped = mean_roughness(now, true, full_scale_m);
  Finding encoding{"depth-encoding", false, 0.95, "depth is stored as plain numbers", "", ""};
  if (listing.depth_encoding == DepthEncoding::rotated3)
    encoding.belief = "depth is stored with its bits rotated by three";
  encoding.evidence = percent_text(as_read.across) + " of neighbouring pixels differ by more than a quarter";

  SequenceListing other = listing;
  const bool rotated_now = listing.depth_encoding == DepthEncoding::rotated3;
  other.depth_encoding = rotated_now ? DepthEncoding::plain : DepthEncoding::rotated3;
  const std::vector<DepthImage> otherwise = few_depths(path, options, other);
  const Roughness otherwise_read =
      otherwise.empty() ? Roughness{1, 1, 1} : mean_roughness(otherwise, false, full_scale_m);
  const double other_across = otherwise_read.across;
  // Smooth close-ups wrap around seldom, so the share itself says little: what tells is that it falls when read
  // otherwise.
  // Where bits are rotated, numbers run over: beside the largest stands one near 0. No surface does that.
  const bool runs_over = as_read.wraps > 0.001 && otherwise_read.wraps < 0.1 * as_read.wraps;
  // Three bits rotated downwards are the highest of depth, which surfaces rarely change.
  const double low_bits = rotated_now ? 0 : share_of_equal_low_bits(now, listing.depth_scale);
  const bool high_bits_below = low_bits > 0.9 && other_across <= as_read.across;
  if (high_bits_below || ((as_read.across > 0.05 || runs_over) && other_across < 0.4 * as_read.across)) {
    encoding.faulty = true;
    encoding.belief = rotated_now ? "depth is stored as plain numbers"
                                  : "the bits of depth are rotated by three (picking challenge, SUN RGB-D)";
    if (runs_over) encoding.evidence += ", " + percent_text(as_read.wraps) + " from near 0 to near the largest number";
    if (high_bits_below)
      encoding.evidence +=
          ", the three lowest bits of " + percent_text(low_bits) + " of different neighbours agree, and ";
    encoding.evidence += (high_bits_below ? "" : ", but ") + percent_text(other_across) + " read so";
    encoding.remedy = rotated_now ? "--depth-encoding plain" : "--depth-encoding rotated3 --depth-scale 10000";
    if (rotated_now != (listing.depth_scale == 10000)) other.depth_scale = rotated_now ? 1000 : 10000;
    listing = other;
    return {encoding};
  }
  if (as_read.down > 0.2 && swapped.down < 0.4 * as_read.down && now.front().width() != now.front().height()) {
    Finding size{"image-size", true,
                 0.9,          "rows of the depth images have another length: width and height are exchanged",
                 "",           ""};
    size.evidence = percent_text(as_read.down) + " of pixels differ by more than a quarter from the one below, but " +
                    percent_text(swapped.down) + " in rows of " + std::to_string(now.front().height());
    size.remedy = "write the images again with the right width";
    return {encoding, size};
  }
  return {encoding};
}

}  // namespace felt
