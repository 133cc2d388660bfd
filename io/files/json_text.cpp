#include "io/files/json_text.h"

#include <nlohmann/json.hpp>

namespace felt {
namespace {

template <typename Json>
std::string with_replaced_bytes(const Json& document, int indent) {
  return document.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::string json_text(const nlohmann::json& document, int indent) { return with_replaced_bytes(document, indent); }

std::string json_text(const nlohmann::ordered_json& document, int indent) {
  return with_replaced_bytes(document, indent);
}

}  // namespace felt
