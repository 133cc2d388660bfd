#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace felt {

/// f64: numbers as given. f32: priors and readings rounded to the single precision that a map stores, then the same
/// scalar arithmetic.
enum class InferPrecision { f64, f32 };

/// One answer of `feltmap infer`.
struct InferAnswer {
  std::string json;  ///< one document, no newline
  bool failed = false;
};

/// Evaluates one line of input. A line that cannot be used gives {"error": "<field>: expected ...", "line": number}.
InferAnswer infer_json_line(std::string_view line, size_t number, InferPrecision precision = InferPrecision::f64);

}  // namespace felt
