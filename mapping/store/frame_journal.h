#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace felt {

/// Frames of one sequence that were fused with the same settings.
struct FusedFrames {
  std::string sequence;  ///< fingerprint of the recording: equal for equal recordings wherever they lie
  std::string settings;  ///< what shaped the fusion of these frames, as text (voxel size, truncation, weights, ...)
  std::vector<int64_t> frames;  ///< `Frame::index`, in the order in which they were fused
  bool operator==(const FusedFrames&) const = default;
};

/// What a map was made of: resuming continues after it, and merging refuses to count a frame twice.
struct FrameJournal {
  std::vector<FusedFrames> runs;
  bool operator==(const FrameJournal&) const = default;
};

/// Notes a fused frame: in the last run where sequence and settings are the same, else in a new one.
void record_frame(FrameJournal& journal, const std::string& sequence, const std::string& settings, int64_t index);

/// Number of frames in all runs.
size_t frame_count(const FrameJournal& journal);

/// Whether a frame of a sequence was fused, with whatever settings.
bool holds_frame(const FrameJournal& journal, const std::string& sequence, int64_t index);

/// Frames (sequence, index) that both journals hold, ascending.
std::vector<std::pair<std::string, int64_t>> shared_frames(const FrameJournal& a, const FrameJournal& b);

/// Both journals in one, in an order that does not depend on which came first: runs by sequence and settings, joined
/// where both are equal, frames ascending.
FrameJournal joined(const FrameJournal& a, const FrameJournal& b);

}  // namespace felt
