#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace felt {

/// Frames of one sequence that were fused with the same settings.
struct FusedFrames {
  /// Fingerprint of the recording: equal for equal recordings wherever they lie. Its first 16 characters name the
  /// images, the rest where they were taken.
  std::string sequence;
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

/// Frames (sequence, index) that both journals hold, ascending.
std::vector<std::pair<std::string, int64_t>> shared_frames(const FrameJournal& a, const FrameJournal& b);

/// Number of frames that both journals hold of the same images, taken at other places or times: one recording that was
/// read with other poses or stamps.
size_t frames_of_same_images(const FrameJournal& a, const FrameJournal& b);

/// Whether each has a run of the same images that the other took at other places or times.
bool of_same_images_elsewhere(const FrameJournal& a, const FrameJournal& b);

/// Both journals in one, in an order that does not depend on which came first: runs by sequence and settings, joined
/// where both are equal, frames ascending.
FrameJournal joined(const FrameJournal& a, const FrameJournal& b);

}  // namespace felt
