#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace felt {

/// Row-major image without padding: pixel (u, v) is column u, row v, at `data()[v * width() + u]`.
template <typename T>
class Image {
public:
  Image() = default;
  Image(int width, int height, T value = {}) : width_(width), height_(height), pixels_(size_t(width) * height, value) {}

  int width() const { return width_; }
  int height() const { return height_; }
  size_t size() const { return pixels_.size(); }
  bool empty() const { return pixels_.empty(); }
  T* data() { return pixels_.data(); }
  const T* data() const { return pixels_.data(); }
  T* row(int v) { return pixels_.data() + size_t(v) * width_; }
  const T* row(int v) const { return pixels_.data() + size_t(v) * width_; }
  T& operator()(int u, int v) {
    assert(u >= 0 && u < width_ && v >= 0 && v < height_);
    return row(v)[u];
  }
  const T& operator()(int u, int v) const {
    assert(u >= 0 && u < width_ && v >= 0 && v < height_);
    return row(v)[u];
  }
  auto begin() { return pixels_.begin(); }
  auto end() { return pixels_.end(); }
  auto begin() const { return pixels_.begin(); }
  auto end() const { return pixels_.end(); }
  bool operator==(const Image&) const = default;

private:
  int width_ = 0;
  int height_ = 0;
  std::vector<T> pixels_;
};

/// Four bytes so that one 32-bit gather fetches a pixel; `a` is 255, or 0 where a reader found no colour for the pixel.
struct Rgba8 {
  uint8_t r = 0, g = 0, b = 0, a = 255;
  bool operator==(const Rgba8&) const = default;
};

using DepthImage = Image<float>;     ///< metres along the optical axis; 0 where nothing was measured
using ColorImage = Image<Rgba8>;     ///< sRGB, as stored
using LabelImage = Image<uint16_t>;  ///< class ids of the class table, or kNoLabel

/// Pixel that no label was seen for (outside the labelled image).
inline constexpr uint16_t kNoLabel = 0xffff;

/// Per pixel the m most probable classes (interleaved: entry i of pixel p at `[p * m + i]`), probabilities in [0, 1].
/// Mass missing from 1 belongs to classes that were not kept.
struct ProbabilityImage {
  int width = 0;
  int height = 0;
  int top = 0;  ///< m
  std::vector<uint16_t> class_id;
  std::vector<float> probability;
  bool empty() const { return class_id.empty(); }
};

}  // namespace felt
