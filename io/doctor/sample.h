#pragma once

#include <map>
#include <string>

#include "io/doctor/geometry.h"
#include "io/sequence/reader.h"
#include "io/sequence/sequence_listing.h"

namespace felt {

/// How much of a sequence the doctor decodes: `clusters` places spread over it, at each the frames `offsets` after the
/// place. A sequence of no more than `whole_below` frames is taken whole.
struct SamplePlan {
  int clusters = 8;
  std::vector<int> offsets = {0, 1, 3, 9, 27};
  int whole_below = 36;
  bool whole_trajectory = true;  ///< poses of all frames, which a search for delays needs, not only of the sampled ones
};

struct Sample {
  GeometrySample geometry;
  std::map<std::string, int64_t> skipped;                      ///< sampled frames that could not be read, by reason
  std::map<std::string, std::vector<int64_t>> skipped_frames;  ///< numbers of these
};

/// Decodes the sample. `listing`: of all frames; it is as before when this returns.
Sample take_sample(const std::filesystem::path& path, const SequenceOptions& options, SequenceListing& listing,
                   const SamplePlan& plan);

/// What of a frame is decoded.
enum class Images { depth, depth_and_labels, all };

/// A reader of all frames of the listing, whose depth is not converted from ray length.
std::unique_ptr<SequenceReader> plain_reader(const std::filesystem::path& path, const SequenceOptions& options,
                                             SequenceListing listing, Images images);

/// One decoded frame with its points; empty points where there are none.
SampledFrame sampled_frame(Frame frame, int64_t position);

}  // namespace felt
