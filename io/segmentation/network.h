#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "io/segmentation/net_description.h"

namespace felt {

/// Planes of floats: value (u, v) of plane c at `[(c * height + v) * width + u]`.
struct Planes {
  int count = 0, width = 0, height = 0;
  std::vector<float> value;
};

/// A loaded network. One thread at a time may run it.
class Network {
public:
  virtual ~Network() = default;
  /// The output [1, k, h, w] (or [1, h, w]: k = 1) for an input [1, 3, height, width], k planes. Throws FormatError
  /// naming the model where the library cannot run it on this input or where it gives another shape.
  virtual Planes run(const Planes& input) = 0;
};

/// What is loaded once and shared by the threads that each open a network of their own.
struct NetModel {
  NetDescription description;  ///< input, output and a fixed input size filled in from the model
  NetBackend backend = NetBackend::opencv;
  std::string bytes;  ///< the ONNX file
};

/// Reads the model and checks the description against it: names of input and output, three input planes, fixed sizes,
/// number of classes. Throws IoError, FormatError (no ONNX model) or ConfigError with every mismatch, naming the file
/// and what it holds.
NetModel load_net_model(const NetDescription& description);

/// Opens the model with its backend. Throws FormatError naming the model and the operator where the library cannot run
/// it. The OpenCV backend sets OpenCV to one thread for the process: the threads of the frame pipeline each run a
/// network, which uses the cores better than all of them on one.
std::unique_ptr<Network> open_network(const NetModel& model);

/// "opencv", and "onnxruntime" where the program was built with it.
std::vector<std::string> available_net_backends();

// The two libraries, each in a file of its own (io/segmentation/<library>_network.cpp).
std::unique_ptr<Network> open_opencv_network(const NetModel& model);
std::unique_ptr<Network> open_onnxruntime_network(const NetModel& model);
bool has_onnxruntime();

}  // namespace felt
