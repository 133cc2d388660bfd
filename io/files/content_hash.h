#pragma once

#include <string>
#include <string_view>

namespace felt {

/// XXH3, 128 bits, as 32 hexadecimal digits: names a content.
std::string content_hash(std::string_view bytes);

}  // namespace felt
