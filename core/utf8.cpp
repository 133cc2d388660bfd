#include "core/utf8.h"

#include <cstddef>
#include <cstdint>

namespace felt {

bool is_utf8(std::string_view text) {
  for (size_t at = 0; at < text.size();) {
    const auto lead = uint8_t(text[at]);
    const size_t more = lead < 0x80 ? 0 : lead >> 5 == 0x6 ? 1 : lead >> 4 == 0xe ? 2 : lead >> 3 == 0x1e ? 3 : 4;
    if (more == 4 || text.size() - at <= more) return false;
    uint32_t code = more == 0 ? lead : lead & (0x3f >> more);
    for (size_t i = 1; i <= more; ++i) {
      const auto next = uint8_t(text[at + i]);
      if (next >> 6 != 0x2) return false;
      code = code << 6 | (next & 0x3f);
    }
    constexpr uint32_t kLeast[] = {0, 0x80, 0x800, 0x10000};  // that needs as many bytes
    if (code < kLeast[more] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return false;
    at += more + 1;
  }
  return true;
}

}  // namespace felt
