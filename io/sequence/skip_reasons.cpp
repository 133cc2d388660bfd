#include "io/sequence/skip_reasons.h"

#include "core/text.h"

namespace felt {

std::string skipped_text(const std::map<std::string, int64_t>& skipped) {
  return listed(skipped, [](const auto& counted) { return std::to_string(counted.second) + " " + counted.first; });
}

}  // namespace felt
