#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace felt {

/// Which frames of a sequence to use: positions first, first + step, ... below `last` in recorded order, counted from 0
/// (a Python slice without negative numbers).
struct FrameSelection {
  int64_t first = 0;
  int64_t last = std::numeric_limits<int64_t>::max();  ///< one past the last
  int64_t step = 1;
  bool operator==(const FrameSelection&) const = default;
};

/// Reads "a:b:step", "a:b", ":b", "a:" or "::step"; parts left out keep their default.
/// Throws ConfigError, naming `where`, for anything else, a step below 1 or b < a.
FrameSelection parse_frame_selection(const std::string& text, const std::string& where);

/// "a:b:step", with b left out where there is no end: the inverse of `parse_frame_selection`.
std::string to_string(const FrameSelection& selection);

/// The selected positions among `count` frames.
std::vector<int64_t> selected_positions(const FrameSelection& selection, int64_t count);

}  // namespace felt
