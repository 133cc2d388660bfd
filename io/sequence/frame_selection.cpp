#include "io/sequence/frame_selection.h"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"

namespace felt {

void select_frames(const FrameSelection& selection, SequenceListing& listing) {
  const int64_t recorded = int64_t(listing.frames.size());
  std::vector<FrameRecord> selected;
  for (const int64_t i : selected_positions(selection, recorded))
    selected.push_back(std::move(listing.frames[size_t(i)]));
  listing.frames = std::move(selected);
  if (listing.frames.empty())
    throw ConfigError(describe_mismatch("frames " + to_string(selection), "selection",
                                        "some of the " + std::to_string(recorded) + " frames", "none"));
}

}  // namespace felt
