#include "io/files/yaml_text.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "io/files/json_text.h"

namespace felt {

std::string yaml_scalar(const std::string& text) {
  const auto plain = [](unsigned char c) { return std::isalnum(c) || c == '_' || c == '-' || c == ' '; };
  if (!text.empty() && std::isalpha(uint8_t(text.front())) && text.back() != ' ' &&
      std::all_of(text.begin(), text.end(), plain))
    return text;
  // Line ends and the like: a string of JSON is one of YAML.
  if (std::any_of(text.begin(), text.end(), [](unsigned char c) { return std::iscntrl(c) != 0; }))
    return json_text(nlohmann::json(text));
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace felt
