#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "apps/options/problems.h"
#include "io/sequence/sequence_options.h"

namespace felt::apps {

/// Whether a path names a sequence and no other file: they are folders, but for containers and single scans.
bool names_sequence(const std::filesystem::path& path);

/// How a sequence is to be read, in the command line's own words: shared by reconstruct, doctor, info and convert. What
/// is left empty is found in the sequence or is the layout's default.
struct ReadingArguments {
  std::string format, intrinsics, pose_convention, depth_encoding, frames;
  std::filesystem::path labels, probs, classes;
  std::optional<double> depth_scale, max_dt_s;
  std::optional<bool> ray_length, no_color, bgr;
  std::optional<double> stamp_offset;
  std::string distortion, body_camera;
  std::optional<int> label_offset;
};

/// Their group in the help.
inline constexpr const char* kReadingGroup = "Sequence (found in it, or the layout's default, unless given)";

/// Adds the options in that group.
void add_reading_options(CLI::App& command, ReadingArguments& arguments);

/// Lays what was given over `base` (a configuration file's settings, or defaults). Adds to `problems` what cannot be
/// used.
SequenceOptions resolve(const ReadingArguments& arguments, SequenceOptions base, Problems& problems);

/// The same without a base; throws as `Problems::throw_if_any` does.
SequenceOptions resolve(const ReadingArguments& arguments);

}  // namespace felt::apps
