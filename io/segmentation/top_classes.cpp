#include "io/segmentation/top_classes.h"

#include <algorithm>
#include <cmath>

namespace felt {
namespace {

/// Where the pixels of one axis lie on the grid: between cells first and second, `weight` of the second.
struct Tap {
  int first, second;
  float weight;
};

std::vector<Tap> taps(int pixels, int cells) {
  std::vector<Tap> all;
  for (int i = 0; i < pixels; ++i) {
    const double x = std::clamp((i + 0.5) * cells / pixels - 0.5, 0.0, double(cells - 1));
    const int first = int(x);
    all.push_back({first, std::min(first + 1, cells - 1), float(x - first)});
  }
  return all;
}

/// The end of the run of taps that lie between the same cells as tap `i`.
int run_end(const std::vector<Tap>& all, int i) {
  int end = i + 1;
  while (end < int(all.size()) && all[size_t(end)].first == all[size_t(i)].first) ++end;
  return end;
}

/// Classes that can be among the `top` of any pixel between four cells: an interpolated probability lies between those
/// of its corners, so a class whose greatest corner is below `top` least corners of others is out of it.
class Candidates {
public:
  Candidates(int classes, int top) : classes_(classes), top_(std::min(top, classes)), least_(size_t(classes)) {}

  const std::vector<int>& find(const float* a, const float* b, const float* c, const float* d) {
    for (int i = 0; i < classes_; ++i) least_[size_t(i)] = std::min(std::min(a[i], b[i]), std::min(c[i], d[i]));
    sorted_ = least_;
    std::nth_element(sorted_.begin(), sorted_.begin() + (top_ - 1), sorted_.end(), std::greater<>());
    const float bound = sorted_[size_t(top_ - 1)] * (1 - 1e-5f);  // rounding of the interpolation
    found_.clear();
    for (int i = 0; i < classes_; ++i)
      if (std::max(std::max(a[i], b[i]), std::max(c[i], d[i])) >= bound) found_.push_back(i);
    return found_;
  }

private:
  int classes_, top_;
  std::vector<float> least_, sorted_;
  std::vector<int> found_;
};

}  // namespace

int64_t class_grid(const Planes& planes, std::span<const uint16_t> target, int classes, NetOutput kind,
                   ClassGrid& grid) {
  const int64_t cells = int64_t(planes.width) * planes.height;
  grid.classes = classes, grid.width = planes.width, grid.height = planes.height;
  grid.probability.assign(size_t(cells * classes), 0.0f);
  std::vector<float> value(size_t(planes.count));
  for (int64_t cell = 0; cell < cells; ++cell) {
    float* const out = &grid.probability[size_t(cell * classes)];
    if (kind == NetOutput::labels) {
      const float label = planes.value[size_t(cell)];
      if (!(label >= 0 && label < float(target.size())) || label != std::floor(label)) return cell;
      out[target[size_t(label)]] = 1;
      continue;
    }
    float sum = 0, greatest = -INFINITY, least = INFINITY;
    for (int i = 0; i < planes.count; ++i) {
      const float x = planes.value[size_t(i * cells + cell)];
      if (!std::isfinite(x)) return cell;
      value[size_t(i)] = x;
      sum += x, greatest = std::max(greatest, x), least = std::min(least, x);
    }
    if (kind == NetOutput::logits) {
      sum = 0;
      for (float& x : value) {
        x = std::exp(x - greatest);
        sum += x;
      }
      for (float& x : value) x /= sum;
    } else if (least < -1e-3f || std::abs(sum - 1) > 0.01f) {
      return cell;
    }
    for (int i = 0; i < planes.count; ++i) out[target[size_t(i)]] += std::max(0.0f, value[size_t(i)]);
  }
  return -1;
}

ProbabilityImage top_classes(const ClassGrid& grid, int width, int height, int top) {
  ProbabilityImage image{width, height, top, {}, {}};
  image.class_id.assign(size_t(width) * height * top, 0);
  image.probability.assign(size_t(width) * height * top, 0.0f);
  const std::vector<Tap> columns = taps(width, grid.width), rows = taps(height, grid.height);
  const auto cell = [&](int u, int v) {
    return &grid.probability[(size_t(v) * grid.width + size_t(u)) * grid.classes];
  };
  Candidates candidates(grid.classes, top);
  for (int v0 = 0; v0 < height; v0 = run_end(rows, v0))
    for (int u0 = 0; u0 < width; u0 = run_end(columns, u0)) {
      const Tap& x = columns[size_t(u0)];
      const Tap& y = rows[size_t(v0)];
      const float *const a = cell(x.first, y.first), *const b = cell(x.second, y.first),
                         *const c = cell(x.first, y.second), *const d = cell(x.second, y.second);
      const std::vector<int>& possible = candidates.find(a, b, c, d);
      for (int v = v0; v < run_end(rows, v0); ++v)
        for (int u = u0; u < run_end(columns, u0); ++u) {
          const float fx = columns[size_t(u)].weight, fy = rows[size_t(v)].weight;
          const size_t at = (size_t(v) * width + u) * top;
          uint16_t* const ids = &image.class_id[at];
          float* const p = &image.probability[at];
          int kept = 0;
          for (const int i : possible) {
            const float upper = (1 - fx) * a[i] + fx * b[i], lower = (1 - fx) * c[i] + fx * d[i];
            const float value = (1 - fy) * upper + fy * lower;
            int place = kept;
            while (place > 0 && value > p[place - 1]) --place;
            if (place == top) continue;
            kept = std::min(kept + 1, top);
            for (int j = kept - 1; j > place; --j) p[j] = p[j - 1], ids[j] = ids[j - 1];
            p[place] = value, ids[place] = uint16_t(i);
          }
        }
    }
  return image;
}

}  // namespace felt
