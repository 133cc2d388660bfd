#include "io/segmentation/segmenter.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "core/error.h"

namespace felt {
namespace {

/// What pixels of no class hold: the table's first ignored class, or kNoLabel.
uint16_t id_of_none(const ClassTable& classes) {
  const auto ignored =
      std::find_if(classes.classes().begin(), classes.classes().end(), [](const ClassInfo& c) { return c.ignore; });
  return ignored == classes.classes().end() ? kNoLabel : ignored->id;
}

const char* expected_of(NetOutput kind) {
  switch (kind) {
    case NetOutput::logits:
      return "finite logits";
    case NetOutput::labels:
      return "numbers of the described classes, from 0";
    case NetOutput::probabilities:
      return "probabilities that sum to 1 (or `kind: logits` in the description)";
  }
  return "";
}

}  // namespace

Segmenter::Segmenter(const NetDescription& net, const ClassTable& classes)
    : model_(load_net_model(net)), classes_(classes.empty() ? own_class_table(net) : classes) {
  const std::vector<uint16_t> slots = map_classes(net, classes_);
  // Classes of the network that share a place are one class here; all that is none is the last.
  std::vector<uint16_t> used = slots;
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  for (const uint16_t slot : slots)
    target_.push_back(uint16_t(std::lower_bound(used.begin(), used.end(), slot) - used.begin()));
  for (const uint16_t slot : used)
    id_of_target_.push_back(slot == ClassTable::kNoSlot ? id_of_none(classes_) : classes_.at_slot(slot).id);
  idle_.push_back(open_network(model_));
}

Planes Segmenter::input_of(const ColorImage& color) const {
  const NetDescription& net = model_.description;
  const int width = net.width > 0 ? net.width : color.width(), height = net.height > 0 ? net.height : color.height();
  const cv::Mat image(color.height(), color.width(), CV_8UC4, const_cast<Rgba8*>(color.data()));
  cv::Mat resized;
  cv::resize(image, resized, cv::Size(width, height), 0, 0, cv::INTER_LINEAR);
  Planes input{3, width, height, std::vector<float>(size_t(3) * width * height)};
  for (int plane = 0; plane < 3; ++plane) {
    float table[256];
    const float inverse_std = 1 / net.std[size_t(plane)];
    for (int v = 0; v < 256; ++v) table[v] = (float(v) * net.scale - net.mean[size_t(plane)]) * inverse_std;
    const int channel = net.bgr ? 2 - plane : plane;
    float* out = &input.value[size_t(plane) * width * height];
    for (int v = 0; v < height; ++v) {
      const uint8_t* row = resized.ptr<uint8_t>(v);
      for (int u = 0; u < width; ++u) *out++ = table[row[4 * u + channel]];
    }
  }
  return input;
}

Planes Segmenter::run(const ColorImage& color) const {
  const Planes input = input_of(color);
  std::unique_ptr<Network> network;
  {
    const std::scoped_lock lock(mutex_);
    if (!idle_.empty()) {
      network = std::move(idle_.back());
      idle_.pop_back();
    }
  }
  if (!network) network = open_network(model_);
  Planes output = network->run(input);
  const std::scoped_lock lock(mutex_);
  idle_.push_back(std::move(network));
  return output;
}

ProbabilityImage Segmenter::segment(const ColorImage& color, int top, int64_t frame) const {
  const NetDescription& net = model_.description;
  const Planes output = run(color);
  const bool labels = net.kind == NetOutput::labels;
  if (output.count != (labels ? 1 : int(net.classes.size())))
    throw FormatError(describe_mismatch(
        net.file.string(), "output " + net.output,
        labels ? "one plane of labels"
               : std::to_string(net.classes.size()) + " classes as " + net.described_in.string() + " names",
        std::to_string(output.count) + " planes"));
  ClassGrid grid;
  const int64_t faulty = class_grid(output, target_, int(id_of_target_.size()), net.kind, grid);
  if (faulty >= 0)
    throw FormatError(describe_mismatch(
        net.file.string(), "output " + net.output + ", frame " + std::to_string(frame), expected_of(net.kind),
        "others at cell (" + std::to_string(faulty % grid.width) + ", " + std::to_string(faulty / grid.width) + ")"));
  ProbabilityImage image = top_classes(grid, color.width(), color.height(), top);
  for (uint16_t& id : image.class_id) id = id_of_target_[id];
  return image;
}

LabelImage most_probable_labels(const ProbabilityImage& probabilities) {
  LabelImage labels(probabilities.width, probabilities.height, kNoLabel);
  for (size_t p = 0; p < labels.size(); ++p)
    if (probabilities.probability[p * size_t(probabilities.top)] > 0)
      labels.data()[p] = probabilities.class_id[p * size_t(probabilities.top)];
  return labels;
}

}  // namespace felt
