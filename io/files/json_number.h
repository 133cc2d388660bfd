#pragma once

#include <cstdint>
#include <string>
#include <utility>

#include "core/error.h"

namespace felt {

/// The whole number that a value of JSON holds. Throws FormatError where it is none or does not fit: the library itself
/// would cast, which cuts 70000 to 16 bits and is undefined for 1e74.
template <typename Int, typename Json>
Int whole_number(const Json& value) {
  if (value.is_number_unsigned()) {
    if (const auto number = value.template get<uint64_t>(); std::in_range<Int>(number)) return Int(number);
  } else if (value.is_number_integer()) {
    if (const auto number = value.template get<int64_t>(); std::in_range<Int>(number)) return Int(number);
  }
  throw FormatError("expected a whole number that fits " + std::to_string(8 * sizeof(Int)) + " bits");
}

}  // namespace felt
