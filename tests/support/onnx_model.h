#pragma once

#include <array>
#include <filesystem>
#include <string>
#include <vector>

namespace felt::test {

/// A network small enough to write by hand: one 1x1 convolution from colour to class logits and a softmax.
struct TestNet {
  /// Per class the weights of the three input planes and a bias: logit = w . input + bias.
  std::vector<std::array<float, 4>> classes;
  bool softmax = true;
  std::string last_operator = "Softmax";  ///< in its place, for networks that no library knows
  std::string input = "image", output = "prob";
  int width = 0, height = 0;  ///< of the input; 0: any
};

/// Logits of "nearest to a prototype colour" (0 .. 1 per plane): 2 s c . x - s c . c for each prototype c, s the
/// sharpness.
TestNet nearest_color_net(const std::vector<std::array<float, 3>>& prototypes, float sharpness = 20);

/// Bytes of the network as an ONNX file, made field by field of its protocol buffer.
std::string onnx_model(const TestNet& net);

/// Writes `net.onnx` and `net.yaml` (classes named by `names`, `more` lines at its end) to a folder; the path of
/// `net.yaml`.
std::filesystem::path write_net(const std::filesystem::path& folder, const TestNet& net,
                                const std::vector<std::string>& names, const std::string& more = "");

}  // namespace felt::test
