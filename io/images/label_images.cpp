#include "io/images/label_images.h"

#include <algorithm>
#include <cmath>

#include "io/images/image_encode.h"

namespace felt {

std::vector<uint8_t> encode_labels(const LabelImage& labels, const ClassTable& classes) {
  const bool narrow =
      std::all_of(classes.classes().begin(), classes.classes().end(), [](const ClassInfo& c) { return c.id < 256; }) &&
      std::all_of(labels.begin(), labels.end(), [](uint16_t id) { return id < 256; });
  if (!narrow) return encode_png(labels);
  Image<uint8_t> bytes(labels.width(), labels.height());
  std::copy(labels.begin(), labels.end(), bytes.begin());
  return encode_png(bytes);
}

std::vector<uint8_t> encode_probabilities(const ProbabilityImage& p) {
  Image<uint16_t> planes(p.width, 2 * p.top * p.height);
  const size_t pixels = size_t(p.width) * p.height;
  for (size_t i = 0; i < pixels; ++i)
    for (int r = 0; r < p.top; ++r) {
      planes.data()[r * pixels + i] = p.class_id[i * p.top + r];
      planes.data()[(p.top + r) * pixels + i] = uint16_t(std::lround(65535 * double(p.probability[i * p.top + r])));
    }
  return encode_png(planes);
}

}  // namespace felt
