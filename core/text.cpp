#include "core/text.h"

#include <cstdio>

namespace felt {

std::string number_text(double value, const char* format) {
  std::string text(size_t(snprintf(nullptr, 0, format, value)), '\0');
  snprintf(text.data(), text.size() + 1, format, value);
  return text;
}

}  // namespace felt
