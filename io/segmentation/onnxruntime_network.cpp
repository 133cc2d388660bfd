#include "core/error.h"
#include "core/text.h"
#include "io/segmentation/network.h"

#ifdef FELTMAP_HAVE_ONNXRUNTIME
#include <onnxruntime_cxx_api.h>

#include <algorithm>
#include <array>

namespace felt {
namespace {

Ort::Env& environment() {
  static Ort::Env env(ORT_LOGGING_LEVEL_FATAL, "feltmap");
  return env;
}

class OnnxRuntimeNetwork final : public Network {
public:
  explicit OnnxRuntimeNetwork(const NetModel& model) : net_description_(model.description) {
    Ort::SessionOptions options;
    options.SetIntraOpNumThreads(1);  // each thread of the frame pipeline runs a network of its own
    options.SetInterOpNumThreads(1);
    try {
      session_ = Ort::Session(environment(), model.bytes.data(), model.bytes.size(), options);
    } catch (const Ort::Exception& fault) {
      fail("a model that ONNX Runtime can load", fault);
    }
  }

  Planes run(const Planes& input) override {
    const std::array<int64_t, 4> shape = {1, input.count, input.height, input.width};
    const char* const inputs[] = {net_description_.input.c_str()};
    const char* const outputs[] = {net_description_.output.c_str()};
    try {
      const auto memory = Ort::MemoryInfo::CreateCpu(OrtArenaAllocator, OrtMemTypeDefault);
      const Ort::Value image = Ort::Value::CreateTensor<float>(memory, const_cast<float*>(input.value.data()),
                                                               input.value.size(), shape.data(), shape.size());
      std::vector<Ort::Value> result = session_.Run(Ort::RunOptions{nullptr}, inputs, &image, 1, outputs, 1);
      const auto info = result[0].GetTensorTypeAndShapeInfo();
      const std::vector<int64_t> size = info.GetShape();
      const auto type = info.GetElementType();
      const bool floats = type == ONNX_TENSOR_ELEMENT_DATA_TYPE_FLOAT,
                 integers = type == ONNX_TENSOR_ELEMENT_DATA_TYPE_INT64;
      if ((size.size() != 4 && size.size() != 3) || size[0] != 1 || !(floats || integers))
        throw FormatError(
            describe_mismatch(net_description_.file.string(), "output " + net_description_.output,
                              "numbers of shape [1, classes, height, width]",
                              std::to_string(size.size()) + " dimensions of type " + std::to_string(type)));
      const size_t n = size.size();
      Planes planes{n == 4 ? int(size[1]) : 1, int(size[n - 1]), int(size[n - 2]), {}};
      const auto take = [&](const auto* first) { planes.value.assign(first, first + info.GetElementCount()); };
      floats ? take(result[0].GetTensorData<float>()) : take(result[0].GetTensorData<int64_t>());
      return planes;
    } catch (const Ort::Exception& fault) {
      fail("a model that ONNX Runtime can run on an input of " + size_text(input.width, input.height), fault);
    }
  }

private:
  [[noreturn]] void fail(const std::string& expected, const Ort::Exception& fault) const {
    const std::string text = fault.what();
    throw FormatError(describe_mismatch(net_description_.file.string(), "network", expected,
                                        text.substr(0, std::min<size_t>(text.find('\n'), 300))));
  }

  NetDescription net_description_;
  Ort::Session session_{nullptr};
};

}  // namespace

bool has_onnxruntime() { return true; }
std::unique_ptr<Network> open_onnxruntime_network(const NetModel& model) {
  return std::make_unique<OnnxRuntimeNetwork>(model);
}

}  // namespace felt

#else

namespace felt {

bool has_onnxruntime() { return false; }
std::unique_ptr<Network> open_onnxruntime_network(const NetModel& model) {
  throw ConfigError(describe_mismatch(model.description.described_in.string(), "backend", "opencv",
                                      "onnxruntime, which this program was built without"));
}

}  // namespace felt
#endif
