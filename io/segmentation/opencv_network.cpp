#include <opencv2/core/utility.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/dnn.hpp>

#include "core/error.h"
#include "core/text.h"
#include "io/segmentation/network.h"

namespace felt {
namespace {

/// OpenCV prints each error before it throws it; ours is one line, printed once.
int say_nothing(int, const char*, const char*, const char*, int, void*) { return 0; }

/// What an exception of OpenCV says, on one line and without the places in its sources.
std::string reason_of(const cv::Exception& fault) {
  std::string text = fault.err.empty() ? fault.what() : fault.err;
  text = text.substr(0, text.find('\n'));
  if (const size_t place = text.find("OpenCV("); place != std::string::npos) text.resize(place);
  while (!text.empty() && (text.back() == ' ' || text.back() == ':' || text.back() == '>')) text.pop_back();
  return text.substr(0, 300);
}

class OpenCvNetwork final : public Network {
public:
  explicit OpenCvNetwork(const NetModel& model) : net_description_(model.description) {
    cv::redirectError(say_nothing);
    cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
    cv::setNumThreads(1);
    try {
      net_ = cv::dnn::readNetFromONNX(model.bytes.data(), model.bytes.size());
      // With fused layers OpenCV 4.6 silently gives other results on some networks.
      net_.enableFusion(false);
      net_.setPreferableBackend(cv::dnn::DNN_BACKEND_OPENCV);
      net_.setPreferableTarget(cv::dnn::DNN_TARGET_CPU);
    } catch (const std::exception& fault) {
      fail("a model whose operators OpenCV's dnn module knows", fault);
    }
  }

  Planes run(const Planes& input) override {
    const int shape[] = {1, input.count, input.height, input.width};
    try {
      net_.setInput(cv::Mat(4, shape, CV_32F, const_cast<float*>(input.value.data())), net_description_.input);
      const cv::Mat output = net_.forward(net_description_.output);
      const int dims = output.dims;
      if ((dims != 4 && dims != 3) || output.size[0] != 1 || output.type() != CV_32F || !output.isContinuous())
        throw FormatError(
            describe_mismatch(net_description_.file.string(), "output " + net_description_.output,
                              "floats of shape [1, classes, height, width]",
                              std::to_string(dims) + " dimensions of type " + cv::typeToString(output.type())));
      Planes planes{dims == 4 ? output.size[1] : 1, output.size[dims - 1], output.size[dims - 2], {}};
      planes.value.assign(output.ptr<float>(), output.ptr<float>() + output.total());
      return planes;
    } catch (const cv::Exception& fault) {
      fail("a model that OpenCV's dnn module can run on an input of " + size_text(input.width, input.height), fault);
    }
  }

private:
  [[noreturn]] void fail(const std::string& expected, const std::exception& fault) const {
    const auto* theirs = dynamic_cast<const cv::Exception*>(&fault);
    throw FormatError(describe_mismatch(net_description_.file.string(), "network", expected,
                                        theirs != nullptr ? reason_of(*theirs) : fault.what()));
  }

  NetDescription net_description_;
  cv::dnn::Net net_;
};

}  // namespace

std::unique_ptr<Network> open_opencv_network(const NetModel& model) { return std::make_unique<OpenCvNetwork>(model); }

}  // namespace felt
