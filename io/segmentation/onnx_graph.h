#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace felt {

/// A named tensor at the edge of a network. A size that the file leaves open is -1.
struct OnnxValue {
  std::string name;
  std::vector<int64_t> shape;
};

/// What an ONNX file says of its graph without being run: enough to tell a user what is wrong with a description.
struct OnnxGraph {
  std::vector<OnnxValue> inputs;  ///< without the weights
  std::vector<OnnxValue> outputs;
};

/// Reads the edges of the graph of an ONNX model (a protocol buffer; weights are passed over). Throws FormatError
/// naming `where` for bytes that are no ONNX model or end too early.
OnnxGraph read_onnx_graph(std::string_view model, const std::string& where);

/// "prob [1, 32, 128, 128], features [1, 64, ?, ?]"
std::string describe(const std::vector<OnnxValue>& values);

}  // namespace felt
