#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace felt {

/// A document as text: on one line, or with `indent` blanks a level. Bytes that are no UTF-8 (in paths, in names of
/// files that others wrote), which JSON cannot hold, are replaced.
std::string json_text(const nlohmann::json& document, int indent = -1);
std::string json_text(const nlohmann::ordered_json& document, int indent = -1);

}  // namespace felt
