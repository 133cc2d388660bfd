#include "tests/support/onnx_model.h"

#include <cstdint>
#include <cstring>
#include <fstream>

namespace felt::test {
namespace {

std::string varint(uint64_t value) {
  std::string bytes;
  for (; value >= 128; value >>= 7) bytes += char(value | 128);
  return bytes + char(value);
}

// Fields of the wire format: a number, and bytes (a text or a message).
std::string number(uint32_t field, uint64_t value) { return varint(field << 3) + varint(value); }
std::string bytes(uint32_t field, const std::string& content) {
  return varint(field << 3 | 2) + varint(content.size()) + content;
}

std::string ints_attribute(const std::string& name, const std::vector<int>& values) {
  std::string attribute = bytes(1, name);
  for (const int value : values) attribute += number(8, uint64_t(value));
  return bytes(5, attribute + number(20, 7));
}
std::string int_attribute(const std::string& name, int value) {
  return bytes(5, bytes(1, name) + number(3, uint64_t(value)) + number(20, 2));
}

std::string tensor(const std::string& name, const std::vector<int>& shape, const std::vector<float>& values) {
  std::string message;
  for (const int size : shape) message += number(1, uint64_t(size));
  std::string raw(values.size() * sizeof(float), '\0');
  std::memcpy(raw.data(), values.data(), raw.size());
  return bytes(5, message + number(2, 1) + bytes(8, name) + bytes(9, raw));
}

/// A value at the edge of the graph: field 11 (input) or 12 (output). A size of 0 is left open.
std::string value(uint32_t field, const std::string& name, const std::vector<int>& shape) {
  std::string dims;
  for (size_t i = 0; i < shape.size(); ++i)
    dims += bytes(1, shape[i] > 0 ? number(1, uint64_t(shape[i])) : bytes(2, "d" + std::to_string(i)));
  return bytes(field, bytes(1, name) + bytes(2, bytes(1, number(1, 1) + bytes(2, dims))));
}

}  // namespace

TestNet nearest_color_net(const std::vector<std::array<float, 3>>& prototypes, float sharpness) {
  TestNet net;
  for (const auto& c : prototypes)
    net.classes.push_back({2 * sharpness * c[0], 2 * sharpness * c[1], 2 * sharpness * c[2],
                           -sharpness * (c[0] * c[0] + c[1] * c[1] + c[2] * c[2])});
  return net;
}

std::string onnx_model(const TestNet& net) {
  const int k = int(net.classes.size());
  std::vector<float> weights, biases;
  for (const auto& c : net.classes) {
    weights.insert(weights.end(), c.begin(), c.begin() + 3);
    biases.push_back(c[3]);
  }
  const std::string logits = net.softmax ? "logits" : net.output;
  std::string graph = bytes(1, bytes(1, net.input) + bytes(1, "w") + bytes(1, "b") + bytes(2, logits) +
                                   bytes(3, "classifier") + bytes(4, "Conv") + ints_attribute("dilations", {1, 1}) +
                                   int_attribute("group", 1) + ints_attribute("kernel_shape", {1, 1}) +
                                   ints_attribute("pads", {0, 0, 0, 0}) + ints_attribute("strides", {1, 1}));
  if (net.softmax)
    graph += bytes(1, bytes(1, logits) + bytes(2, net.output) + bytes(3, "softmax") + bytes(4, net.last_operator) +
                          int_attribute("axis", 1));
  graph += bytes(2, "test") + tensor("w", {k, 3, 1, 1}, weights) + tensor("b", {k}, biases) +
           value(11, net.input, {1, 3, net.height, net.width}) + value(12, net.output, {1, k, net.height, net.width});
  return number(1, 8) + bytes(2, "test") + bytes(7, graph) + bytes(8, bytes(1, "") + number(2, 13));
}

std::filesystem::path write_net(const std::filesystem::path& folder, const TestNet& net,
                                const std::vector<std::string>& names, const std::string& more) {
  std::ofstream(folder / "net.onnx", std::ios::binary) << onnx_model(net);
  std::ofstream description(folder / "net.yaml");
  description << "file: net.onnx\ninput: {name: " << net.input << "}\noutput: {name: " << net.output
              << ", kind: " << (net.softmax ? "probabilities" : "logits") << "}\nclasses: [";
  for (size_t i = 0; i < names.size(); ++i) description << (i > 0 ? ", " : "") << names[i];
  description << "]\n" << more;
  return folder / "net.yaml";
}

}  // namespace felt::test
