#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace felt {

/// f64: the scalar functions that specify the models. f32: the batch kernels that a map runs, on the chosen SIMD target
/// (io/readings/infer_single.h); `classes` of `material`, noisy readings of `material` and `predict` are f64 in a map
/// too.
enum class InferPrecision { f64, f32 };

/// One answer of `feltmap infer`.
struct InferAnswer {
  std::string json;  ///< one document, no newline
  bool failed = false;
};

/// Evaluates one line of input. A line that cannot be used gives {"error": "<field>: expected ...", "line": number}.
InferAnswer infer_json_line(std::string_view line, size_t number, InferPrecision precision = InferPrecision::f64);

}  // namespace felt
