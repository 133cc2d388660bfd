#include "io/segmentation/network.h"

#include <algorithm>

#include "core/error.h"
#include "io/files/text_input.h"
#include "io/segmentation/onnx_graph.h"

namespace felt {
namespace {

constexpr size_t kModelLimitBytes = size_t(2) << 30;

/// The value called `name`, or the only one where the description names none.
const OnnxValue* value_named(const std::vector<OnnxValue>& values, const std::string& name, const std::string& where,
                             const char* which, std::vector<std::string>& problems) {
  if (name.empty() && values.size() == 1) return &values[0];
  const auto found = std::find_if(values.begin(), values.end(), [&](const OnnxValue& v) { return v.name == name; });
  if (found != values.end()) return &*found;
  problems.push_back(describe_mismatch(where, std::string(which) + " name", "one of " + describe(values),
                                       name.empty() ? "none given" : "'" + name + "'"));
  return nullptr;
}

/// Whether a size of the model admits `wanted` (0: anything).
bool admits(int64_t size, int64_t wanted) { return size < 0 || wanted == 0 || size == wanted; }

void check_input(const OnnxValue& input, NetDescription& net, const std::string& where,
                 std::vector<std::string>& problems) {
  net.input = input.name;
  if (input.shape.empty()) return;
  const bool image = input.shape.size() == 4 && admits(input.shape[0], 1) && admits(input.shape[1], 3);
  if (!image || !admits(input.shape[2], net.height) || !admits(input.shape[3], net.width)) {
    const std::string size =
        net.width == 0 ? "height, width" : std::to_string(net.height) + ", " + std::to_string(net.width);
    problems.push_back(
        describe_mismatch(where, "input " + input.name, "shape [1, 3, " + size + "]", describe({input})));
  } else if (std::max(input.shape[2], input.shape[3]) > kMostPixelsAcross) {
    problems.push_back(describe_mismatch(where, "input " + input.name,
                                         "at most " + std::to_string(kMostPixelsAcross) + " pixels across",
                                         describe({input})));
  } else if (net.width == 0 && input.shape[2] > 0 && input.shape[3] > 0) {
    net.height = int(input.shape[2]), net.width = int(input.shape[3]);
  }
}

void check_output(const OnnxValue& output, NetDescription& net, const std::string& where,
                  std::vector<std::string>& problems) {
  net.output = output.name;
  if (output.shape.empty()) return;
  const bool labels = net.kind == NetOutput::labels, flat = labels && output.shape.size() == 3;
  if (!(flat || output.shape.size() == 4) || !admits(output.shape[0], 1) ||
      (labels && !flat && !admits(output.shape[1], 1)))
    problems.push_back(describe_mismatch(where, "output " + output.name,
                                         labels ? "shape [1, 1, height, width]" : "shape [1, classes, height, width]",
                                         describe({output})));
  else if (!labels && !admits(output.shape[1], int64_t(net.classes.size())))
    problems.push_back(describe_mismatch(
        net.described_in.string(), "classes",
        std::to_string(output.shape[1]) + " names, as many as " + where + " has outputs in " + describe({output}),
        std::to_string(net.classes.size())));
}

NetBackend chosen_backend(const NetDescription& net) {
  if (net.backend == NetBackend::onnxruntime && !has_onnxruntime())
    throw ConfigError(describe_mismatch(net.described_in.string(), "backend", "opencv",
                                        "onnxruntime, which this program was built without"));
  if (net.backend != NetBackend::automatic) return net.backend;
  return has_onnxruntime() ? NetBackend::onnxruntime : NetBackend::opencv;
}

}  // namespace

NetModel load_net_model(const NetDescription& description) {
  NetModel model{description, chosen_backend(description), read_whole_file(description.file, kModelLimitBytes)};
  const std::string where = description.file.string();
  const OnnxGraph graph = read_onnx_graph(model.bytes, where);
  std::vector<std::string> problems;
  if (const OnnxValue* input = value_named(graph.inputs, description.input, where, "input", problems))
    check_input(*input, model.description, where, problems);
  if (graph.inputs.size() > 1)
    problems.push_back(describe_mismatch(where, "inputs", "one image", describe(graph.inputs)));
  if (const OnnxValue* output = value_named(graph.outputs, description.output, where, "output", problems))
    check_output(*output, model.description, where, problems);
  if (!problems.empty()) throw ConfigError(problems);
  return model;
}

std::unique_ptr<Network> open_network(const NetModel& model) {
  return model.backend == NetBackend::onnxruntime ? open_onnxruntime_network(model) : open_opencv_network(model);
}

std::vector<std::string> available_net_backends() {
  return has_onnxruntime() ? std::vector<std::string>{"opencv", "onnxruntime"} : std::vector<std::string>{"opencv"};
}

}  // namespace felt
