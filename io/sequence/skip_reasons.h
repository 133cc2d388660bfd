#pragma once

#include <cstdint>
#include <map>
#include <string>

namespace felt {

/// Why frames are skipped (`SkippedFrame::reason`, `FrameRecord::fault`): the reasons that somebody asks for, or that
/// more than one place gives. `make_listed_sequence` names all.
inline constexpr const char *kMissingPose = "missing pose", *kUnreadablePose = "unreadable pose",
                            *kNonFinitePose = "non-finite pose", *kNonRigidPose = "non-rigid pose",
                            *kStampOutOfOrder = "stamp out of order", *kDepthAllZero = "depth all zero",
                            *kMissingDepth = "missing depth image", *kMissingColor = "missing colour image",
                            *kTruncatedDepth = "truncated depth image";

/// Whether an image of the frame is there and cannot be used.
inline bool is_of_broken_image(const std::string& reason) {
  return reason.ends_with(" image") && !reason.starts_with("missing");
}

/// Skipped frames by reason: "2 missing pose, 1 truncated depth image".
std::string skipped_text(const std::map<std::string, int64_t>& skipped);

}  // namespace felt
