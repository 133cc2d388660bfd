#include "io/sequence/depth_camera.h"

#include <algorithm>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/text.h"
#include "io/sequence/camera_file.h"
#include "io/sequence/image_source.h"

namespace felt {
namespace {

using Size = std::pair<int, int>;

/// Votes of the first depth images that can be read, none of a container whose camera states the size of all.
struct SizeVotes {
  std::vector<Size> sizes;
  std::string last_fault = "no depth image";

  auto of(Size size) const { return std::count(sizes.begin(), sizes.end(), size); }
  Size winner() const {
    return *std::max_element(sizes.begin(), sizes.end(), [&](Size a, Size b) { return of(a) < of(b); });
  }
};

SizeVotes votes_of_first_images(const SequenceListing& listing) {
  constexpr size_t kAsked = 9;
  SizeVotes votes;
  for (const FrameRecord& frame : listing.frames) {
    if (votes.sizes.size() == kAsked) break;
    if (frame.depth.empty()) {
      if (!frame.fault_detail.empty()) votes.last_fault = frame.fault_detail;
      continue;
    }
    if (frame.depth.codec != ImageSource::Codec::image_file) {
      if (listing.width > 0) votes.sizes.emplace_back(listing.width, listing.height);
      break;
    }
    try {
      const ImageHeader header = decoded(frame.depth, "depth", read_image_header);
      votes.sizes.emplace_back(header.width, header.height);
    } catch (const SkipFrame& skip) {
      votes.last_fault = skip.detail;
    }
  }
  return votes;
}

}  // namespace

PinholeCamera find_depth_camera(const SequenceListing& listing, const std::filesystem::path& path) {
  const SizeVotes votes = votes_of_first_images(listing);
  if (votes.sizes.empty())
    throw FormatError(
        describe_mismatch(path.string(), "depth images", "at least one that can be read", votes.last_fault));
  const Size stated{listing.width, listing.height};
  const auto [width, height] = votes.of(stated) > 0 ? stated : votes.winner();
  if (listing.width > 0 && stated != Size{width, height})
    throw FormatError(describe_mismatch(path.string(), "image size",
                                        size_text(listing.width, listing.height) + " as the camera says",
                                        size_text(width, height) + " in the first depth images"));
  const Intrinsics k = listing.intrinsics.value_or(Intrinsics{});
  const PinholeCamera camera{k.fx, k.fy, k.cx, k.cy, width, height};
  check_camera_fits_image(camera, path.string(), listing.lacking_camera_file);
  return camera;
}

}  // namespace felt
