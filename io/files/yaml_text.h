#pragma once

#include <string>

namespace felt {

/// Text as a scalar that YAML reads back: plain where it is made of letters, digits, blanks, '_' and '-'.
std::string yaml_scalar(const std::string& text);

}  // namespace felt
