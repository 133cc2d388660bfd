#include "core/frame_selection.h"

#include <algorithm>
#include <charconv>

#include "core/error.h"

namespace felt {

FrameSelection parse_frame_selection(const std::string& text, const std::string& where) {
  const auto refuse = [&](const std::string& expected) -> ConfigError {
    return ConfigError(describe_mismatch(where, "frames", expected, "'" + text + "'"));
  };
  FrameSelection selection;
  int64_t* const parts[3] = {&selection.first, &selection.last, &selection.step};
  const char* at = text.data();
  const char* const end = text.data() + text.size();
  int part = 0;
  for (;; ++part, ++at) {
    if (part == 3) throw refuse("a:b:step");
    if (at != end && *at != ':') {
      const auto [next, fault] = std::from_chars(at, end, *parts[part]);
      if (fault != std::errc() || *parts[part] < 0) throw refuse("a:b:step with whole numbers from 0");
      at = next;
    }
    if (at == end) break;
    if (*at != ':') throw refuse("a:b:step with whole numbers from 0");
  }
  if (part == 0) throw refuse("a:b:step");
  if (selection.step < 1) throw refuse("a step of at least 1");
  if (selection.last < selection.first) throw refuse("a:b:step with a <= b");
  return selection;
}

std::string to_string(const FrameSelection& selection) {
  const bool open = selection.last == std::numeric_limits<int64_t>::max();
  return std::to_string(selection.first) + ":" + (open ? "" : std::to_string(selection.last)) + ":" +
         std::to_string(selection.step);
}

std::vector<int64_t> selected_positions(const FrameSelection& selection, int64_t count) {
  std::vector<int64_t> positions;
  const int64_t last = std::min(selection.last, count);
  for (int64_t i = selection.first; i < last;) {
    positions.push_back(i);
    if (selection.step >= last - i) break;  // i + step could overflow
    i += selection.step;
  }
  return positions;
}

}  // namespace felt
