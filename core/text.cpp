#include "core/text.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <utility>

namespace felt {

std::string number_text(double value, const char* format) {
  std::string text(size_t(snprintf(nullptr, 0, format, value)), '\0');
  snprintf(text.data(), text.size() + 1, format, value);
  return text;
}

std::string point_text(double x_m, double y_m, double z_m) {
  constexpr double kMillimetresHold_m = 1e12;  // of a double
  std::string text;
  for (const double metres : {x_m, y_m, z_m})
    text += (text.empty() ? "(" : ", ") + number_text(metres, std::abs(metres) < kMillimetresHold_m ? "%.3f" : "%g");
  return text + ")";
}

std::string hexadecimal(uint64_t value) {
  std::string text(16, '0');
  for (size_t digit = text.size(); digit-- > 0; value >>= 4) text[digit] = "0123456789abcdef"[value & 15];
  return text;
}

std::string size_text(int64_t width, int64_t height) { return std::to_string(width) + " x " + std::to_string(height); }

std::string nearest_word(const std::string& word, const std::vector<std::string>& known) {
  // Levenshtein 1966, one row of the table at a time.
  const auto distance = [](const std::string& a, const std::string& b) {
    std::vector<size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), size_t(0));
    for (size_t i = 1; i <= a.size(); ++i) {
      size_t diagonal = std::exchange(row[0], i);
      for (size_t j = 1; j <= b.size(); ++j)
        diagonal = std::exchange(row[j], std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])}));
    }
    return row.back();
  };
  const auto folded = [](std::string text) {
    std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) { return char(std::tolower(c)); });
    return text;
  };
  std::string best;
  size_t least = std::max<size_t>(2, word.size() / 2) + 1;
  if (word.size() > 64) return best;
  for (const std::string& candidate : known)
    if (const size_t d = distance(folded(word), folded(candidate)); d < least) least = d, best = candidate;
  return best;
}

}  // namespace felt
