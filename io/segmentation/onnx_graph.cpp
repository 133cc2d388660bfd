#include "io/segmentation/onnx_graph.h"

#include <algorithm>
#include <set>

#include "core/error.h"

namespace felt {
namespace {

/// One field of a protocol buffer message: a number, or a piece of bytes (text or a message within).
struct Field {
  uint32_t number = 0;
  uint64_t value = 0;
  std::string_view bytes;
};

/// Walks the fields of one message (the wire format: a key with number and type, then the content).
class Message {
public:
  Message(std::string_view bytes, const std::string& where) : rest_(bytes), where_(where) {}

  bool next(Field& field) {
    if (rest_.empty()) return false;
    const uint64_t key = varint();
    field = {uint32_t(key >> 3), 0, {}};
    switch (key & 7) {
      case 0:
        field.value = varint();
        return true;
      case 1:
        take(8);
        return true;
      case 2:
        field.bytes = take(varint());
        return true;
      case 5:
        take(4);
        return true;
      default:
        fail("a field of unknown type");
    }
  }

private:
  [[noreturn]] void fail(const char* found) const {
    throw FormatError(describe_mismatch(where_, "network", "a whole ONNX model", found));
  }
  std::string_view take(uint64_t bytes) {
    if (bytes > rest_.size()) fail("a file that ends too early or is damaged");
    const std::string_view taken = rest_.substr(0, size_t(bytes));
    rest_.remove_prefix(size_t(bytes));
    return taken;
  }
  uint64_t varint() {
    uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      const auto byte = uint8_t(take(1)[0]);
      value |= uint64_t(byte & 127) << shift;
      if (byte < 128) return value;
    }
    fail("a number of too many bytes");
  }

  std::string_view rest_;
  const std::string& where_;
};

/// Calls `visit` for each field of a message with this number.
template <typename Visit>
void for_each_field(std::string_view bytes, uint32_t number, const std::string& where, const Visit& visit) {
  Message message(bytes, where);
  for (Field field; message.next(field);)
    if (field.number == number) visit(field);
}

// Field numbers of onnx.proto3.
constexpr uint32_t kModelGraph = 7, kGraphInitializer = 5, kGraphInput = 11, kGraphOutput = 12, kTensorName = 8,
                   kValueName = 1, kValueType = 2, kTypeTensor = 1, kTensorShape = 2, kShapeDim = 1, kDimValue = 1;

OnnxValue value_of(std::string_view bytes, const std::string& where) {
  OnnxValue value;
  for_each_field(bytes, kValueName, where, [&](const Field& f) { value.name = f.bytes; });
  for_each_field(bytes, kValueType, where, [&](const Field& type) {
    for_each_field(type.bytes, kTypeTensor, where, [&](const Field& tensor) {
      for_each_field(tensor.bytes, kTensorShape, where, [&](const Field& shape) {
        for_each_field(shape.bytes, kShapeDim, where, [&](const Field& dim) {
          int64_t size = -1;
          for_each_field(dim.bytes, kDimValue, where, [&](const Field& f) { size = int64_t(f.value); });
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
  std::set<std::string, std::less<>> weights;
  for_each_field(model, kModelGraph, where, [&](const Field& g) {
    Message message(g.bytes, where);
    for (Field field; message.next(field);) {
      if (field.number == kGraphInput) graph.inputs.push_back(value_of(field.bytes, where));
      if (field.number == kGraphOutput) graph.outputs.push_back(value_of(field.bytes, where));
      if (field.number == kGraphInitializer)
        for_each_field(field.bytes, kTensorName, where, [&](const Field& f) { weights.emplace(f.bytes); });
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
  std::string text;
  for (const OnnxValue& value : values) {
    text += (text.empty() ? "" : ", ") + value.name + " [";
    for (size_t i = 0; i < value.shape.size(); ++i)
      text += (i > 0 ? ", " : "") + (value.shape[i] < 0 ? "?" : std::to_string(value.shape[i]));
    text += "]";
  }
  return text;
}

}  // namespace felt
