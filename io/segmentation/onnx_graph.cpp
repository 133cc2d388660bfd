#include "io/segmentation/onnx_graph.h"

#include <algorithm>
#include <set>

#include "core/error.h"
#include "core/text.h"
#include "io/files/protobuf.h"

namespace felt {
namespace {

using Field = ProtobufField;

// Field numbers of onnx.proto3.
constexpr uint32_t kModelGraph = 7, kGraphInitializer = 5, kGraphInput = 11, kGraphOutput = 12, kTensorName = 8,
                   kValueName = 1, kValueType = 2, kTypeTensor = 1, kTensorShape = 2, kShapeDim = 1, kDimValue = 1;

OnnxValue value_of(std::string_view bytes, const ProtobufFile& file) {
  OnnxValue value;
  for_each_field(bytes, kValueName, file, [&](const Field& f) { value.name = f.bytes; });
  for_each_field(bytes, kValueType, file, [&](const Field& type) {
    for_each_field(type.bytes, kTypeTensor, file, [&](const Field& tensor) {
      for_each_field(tensor.bytes, kTensorShape, file, [&](const Field& shape) {
        for_each_field(shape.bytes, kShapeDim, file, [&](const Field& dim) {
          int64_t size = -1;
          for_each_field(dim.bytes, kDimValue, file, [&](const Field& f) { size = int64_t(f.value); });
          value.shape.push_back(size > 0 ? size : -1);
        });
      });
    });
  });
  return value;
}

}  // namespace

OnnxGraph read_onnx_graph(std::string_view model, const std::string& where) {
  OnnxGraph graph;
  const ProtobufFile file{where, "network", "a whole ONNX model"};
  std::set<std::string, std::less<>> weights;
  for_each_field(model, kModelGraph, file, [&](const Field& g) {
    ProtobufMessage message(g.bytes, file);
    for (Field field; message.next(field);) {
      if (field.number == kGraphInput) graph.inputs.push_back(value_of(field.bytes, file));
      if (field.number == kGraphOutput) graph.outputs.push_back(value_of(field.bytes, file));
      if (field.number == kGraphInitializer)
        for_each_field(field.bytes, kTensorName, file, [&](const Field& f) { weights.emplace(f.bytes); });
    }
  });
  // Old files list the weights among the inputs.
  std::erase_if(graph.inputs, [&](const OnnxValue& v) { return weights.contains(v.name); });
  if (graph.inputs.empty() || graph.outputs.empty())
    throw FormatError(describe_mismatch(
        where, "network", "an ONNX model with an input and an output",
        std::to_string(graph.inputs.size()) + " inputs and " + std::to_string(graph.outputs.size()) + " outputs"));
  return graph;
}

std::string describe(const std::vector<OnnxValue>& values) {
  const auto length = [](int64_t n) { return n < 0 ? "?" : std::to_string(n); };
  return listed(values, [&](const OnnxValue& value) { return value.name + " [" + listed(value.shape, length) + "]"; });
}

}  // namespace felt
