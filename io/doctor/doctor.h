#pragma once

#include <cstdint>
#include <filesystem>
#include <map>

#include "io/doctor/finding.h"
#include "io/sequence/sequence_options.h"

namespace felt {

/// Settings that suit the depth of a sequence, with the numbers that lead to them.
struct MapProposal {
  double voxel_size_m = 0, truncation_m = 0, max_depth_m = 0;
  double median_depth_m = 0, far_depth_m = 0;  ///< the 50th and 98th percentile of depth
  double pixel_m = 0;                          ///< width that a pixel sees at the median depth
};

struct Examination {
  std::string layout;
  int64_t recorded_frames = 0;
  int64_t selected_frames = 0;  ///< of the recorded ones: all that was looked at is of these
  int64_t sampled_frames = 0, frame_pairs = 0;
  std::map<std::string, int64_t> skipped;  ///< sampled frames that could not be read, by reason
  std::vector<Finding> findings;
  MapProposal proposal;
  bool faulty() const;
};

/// Examines a sequence before it is fused: decodes some 40 frames, projects frames into each other under every
/// plausible reading of the recorded numbers, and looks at colours, labels, stamps, files and the trajectory
/// (docs/doctor.md). `options`: as the sequence would be read. Deterministic. Throws as `open_sequence` does where
/// nothing at all can be read.
Examination examine_sequence(const std::filesystem::path& path, const SequenceOptions& options = {});

/// The part of it that takes a few frames only: what is faulty about conventions, depth and colour order. They are
/// those of the whole recording, which tells more of them than the selected frames do.
Examination examine_quickly(const std::filesystem::path& path, const SequenceOptions& options = {});

}  // namespace felt
