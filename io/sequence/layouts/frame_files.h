#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "io/sequence/sequence_listing.h"

namespace felt {

/// Endings of the images that depth is read from.
inline const std::vector<std::string> kDepthEndings = {".png", ".tiff", ".tif", ".exr", ".npy"};

/// Depth images directly in `folder` by number: names of `prefix`, a number, `infix` and one of `kDepthEndings`. Where
/// there are several kinds, those of the first; throws as `numbered_files` does.
std::map<int64_t, std::filesystem::path> depth_files(const std::filesystem::path& folder,
                                                     const std::string& prefix = "", const std::string& infix = "");

/// True where `depth_files` finds some.
bool has_depth_files(const std::filesystem::path& folder, const std::string& prefix = "",
                     const std::string& infix = "");

/// Files of a sequence by frame number, one kind each.
struct FrameFiles {
  using Files = std::map<int64_t, std::filesystem::path>;
  Files depth, color, labels{}, instances{}, probabilities{}, pose{};
};

/// One record for each number of a depth, colour or pose file or of `more_numbers`, ascending, stamped with its number.
std::vector<FrameRecord> frame_records(const FrameFiles& files, const std::vector<int64_t>& more_numbers = {});

/// Takes over what a camera file states: image size, depth scale, and the intrinsics where `options` give none. Throws
/// as read_camera_file does.
void take_camera_file(const std::filesystem::path& file, const SequenceOptions& options, SequenceListing& listing);

/// Takes the camera of the layout's own recordings, for want of `file`, and says so in a note: "the camera of Replica".
void assume_camera(const Intrinsics& intrinsics, const std::string& file, const std::string& whose,
                   SequenceListing& listing);

}  // namespace felt
