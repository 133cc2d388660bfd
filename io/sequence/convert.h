#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "io/sequence/reader.h"

namespace felt {

struct ConvertOptions {
  std::string layout = "generic";  ///< one of `writable_layouts()`
  double depth_scale = 0;  ///< stored units per metre; 0: the layout's own, for generic the sequence's or, where it has
                           ///< less than 100 (floating-point depth, scans), millimetres or what reaches as far. Files
                           ///< of 7scenes and icl state none: only their own there.
  bool renumber = false;   ///< number frames from 0 in every layout
  bool jpeg_color = false;  ///< instead of PNG, which keeps every value
};

/// Stored depth finer than a micrometre is a mistake.
constexpr double kMostDepthScale = 1e6;

struct ConvertResult {
  int64_t written = 0;
  std::map<std::string, int64_t> skipped;  ///< frames that could not be read, by reason
  int64_t depth_measured = 0;              ///< pixels that have depth
  int64_t depth_out_of_range = 0;          ///< of those: too far for 16 bits or too near at the scale, stored as 0
  int64_t touches_elsewhere = 0;           ///< recorded touches of frames that are not written, left out
  std::vector<std::string> left_out;       ///< what the sequence carries and the layout has no place for
};

std::vector<std::string> writable_layouts();

/// Writes what `reader` reads in another layout: depth along the optical axis, colour, labels, probabilities and
/// instances on the depth grid, camera-to-world poses with OpenCV axes, the class table. What the layout has no place
/// for is left out (docs/datasets.md). Frame numbers are kept, except in `replica` and `redwood`, which count from 0,
/// and stamps in `generic` and `tum`. The folder appears whole or not at all: `out` must not exist, or be an empty
/// folder. `progress` gets the number of frames read; false stops, and nothing is left. Throws ConfigError for an
/// unknown layout and a depth scale that its files cannot state, IoError, and FormatError where no frame can be read or
/// most of the measured depth does not fit at the scale.
ConvertResult convert_sequence(const SequenceReader& reader, const std::filesystem::path& out,
                               const ConvertOptions& options, const std::function<bool(int64_t)>& progress = {});

}  // namespace felt
