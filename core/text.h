#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace felt {

/// A number in printf's words; `format` takes one double.
std::string number_text(double value, const char* format = "%g");

/// "(x, y, z)" to the millimetre, and shorter where a coordinate is too large for that to mean anything.
std::string point_text(double x_m, double y_m, double z_m);

/// All 16 hexadecimal digits of a number, in small letters.
std::string hexadecimal(uint64_t value);

/// "640 x 480".
std::string size_text(int64_t width, int64_t height);

/// The known word nearest to `word`: fewest insertions, deletions and replacements; the case of letters does not count.
/// Empty where none is near.
std::string nearest_word(const std::string& word, const std::vector<std::string>& known);

/// The items with ", " between them, each as `text(item)` says it (a member will do: `&Property::name`); behind `most`
/// of them " and N more".
template <typename Range, typename Text = std::identity>
std::string listed(const Range& items, const Text& text = {}, size_t most = SIZE_MAX) {
  std::string list;
  size_t count = 0;
  for (const auto& item : items) {
    if (count++ >= most) continue;
    if (count > 1) list += ", ";
    list += std::invoke(text, item);
  }
  if (count > most) list += " and " + std::to_string(count - most) + " more";
  return list;
}

}  // namespace felt
