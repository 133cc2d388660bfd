#include "io/segmentation/top_classes.h"

#include <algorithm>
#include <cmath>
#include <limits>

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
  Candidates(int classes, int top)
      : classes_(classes), top_(std::min(top, classes)), least_(size_t(classes)), greatest_(size_t(classes)) {}

  const std::vector<int>& find(const float* a, const float* b, const float* c, const float* d) {
    for (int i = 0; i < classes_; ++i) {
      least_[size_t(i)] = lesser(lesser(a[i], b[i]), lesser(c[i], d[i]));
      greatest_[size_t(i)] = greater(greater(a[i], b[i]), greater(c[i], d[i]));
    }
    const float bound = least_at_top() * (1 - 1e-5f);  // rounding of the interpolation
    found_.clear();
    for (int i = 0; i < classes_; ++i)
      if (greatest_[size_t(i)] >= bound) found_.push_back(i);
    return found_;
  }

private:
  // As values, which the compiler makes vectors of.
  static float lesser(float a, float b) { return a < b ? a : b; }
  static float greater(float a, float b) { return a > b ? a : b; }

  /// The `top`-th greatest of the least corners.
  float least_at_top() {
    if (top_ == 1) return *std::max_element(least_.begin(), least_.end());
    sorted_ = least_;
    std::nth_element(sorted_.begin(), sorted_.begin() + (top_ - 1), sorted_.end(), std::greater<>());
    return sorted_[size_t(top_ - 1)];
  }

  int classes_, top_;
  std::vector<float> least_, greatest_, sorted_;
  std::vector<int> found_;
};

/// Cells whose planes are read together: enough for vectors, few enough that planes whose rows lie a power of two apart
/// do not drive each other out of the cache.
constexpr int64_t kCellsAtOnce = 64;

/// What the values of some cells are over all planes.
struct CellValues {
  float sum[kCellsAtOnce], greatest[kCellsAtOnce], least[kCellsAtOnce];
  bool finite[kCellsAtOnce];

  CellValues(const Planes& planes, int64_t cells, int64_t first, int64_t count) {
    std::fill_n(sum, count, 0.0f), std::fill_n(finite, count, true);
    std::fill_n(greatest, count, -INFINITY), std::fill_n(least, count, INFINITY);
    for (int i = 0; i < planes.count; ++i) {
      const float* const value = &planes.value[size_t(i * cells + first)];
      for (int64_t n = 0; n < count; ++n) {
        const float x = value[n];
        finite[n] &= std::fabs(x) <= std::numeric_limits<float>::max();
        sum[n] += x;
        greatest[n] = greatest[n] < x ? x : greatest[n];
        least[n] = x < least[n] ? x : least[n];
      }
    }
  }
};

}  // namespace

int64_t class_grid(const Planes& planes, std::span<const uint16_t> target, int classes, NetOutput kind,
                   ClassGrid& grid) {
  const int64_t cells = int64_t(planes.width) * planes.height;
  grid.classes = classes, grid.width = planes.width, grid.height = planes.height;
  grid.probability.assign(size_t(cells * classes), 0.0f);
  if (kind == NetOutput::labels) {
    for (int64_t cell = 0; cell < cells; ++cell) {
      const float label = planes.value[size_t(cell)];
      if (!(label >= 0 && label < float(target.size())) || label != std::floor(label)) return cell;
      grid.probability[size_t(cell * classes) + target[size_t(label)]] = 1;
    }
    return -1;
  }
  std::vector<float> weight(size_t(planes.count));
  for (int64_t first = 0; first < cells; first += kCellsAtOnce) {
    const int64_t count = std::min(kCellsAtOnce, cells - first);
    const CellValues values(planes, cells, first, count);
    for (int64_t n = 0; n < count; ++n)
      if (!values.finite[n] ||
          (kind == NetOutput::probabilities && (values.least[n] < -1e-3f || std::abs(values.sum[n] - 1) > 0.01f)))
        return first + n;
    float* const out = &grid.probability[size_t(first * classes)];
    const auto value = [&](int i, int64_t n) { return planes.value[size_t(i * cells + first + n)]; };
    if (kind == NetOutput::probabilities) {
      for (int i = 0; i < planes.count; ++i)
        for (int64_t n = 0; n < count; ++n) out[n * classes + target[size_t(i)]] += std::max(0.0f, value(i, n));
      continue;
    }
    for (int64_t n = 0; n < count; ++n) {
      float sum = 0;
      for (int i = 0; i < planes.count; ++i) sum += weight[size_t(i)] = std::exp(value(i, n) - values.greatest[n]);
      for (int i = 0; i < planes.count; ++i) out[n * classes + target[size_t(i)]] += weight[size_t(i)] / sum;
    }
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
  for (int v0 = 0, v1; v0 < height; v0 = v1) {
    v1 = run_end(rows, v0);
    for (int u0 = 0, u1; u0 < width; u0 = u1) {
      u1 = run_end(columns, u0);
      const Tap& x = columns[size_t(u0)];
      const Tap& y = rows[size_t(v0)];
      const float *const a = cell(x.first, y.first), *const b = cell(x.second, y.first),
                         *const c = cell(x.first, y.second), *const d = cell(x.second, y.second);
      const std::vector<int>& possible = candidates.find(a, b, c, d);
      for (int v = v0; v < v1; ++v)
        for (int u = u0; u < u1; ++u) {
          const float fx = columns[size_t(u)].weight, fy = rows[size_t(v)].weight;
          const auto interpolated = [&](int i) {
            const float upper = (1 - fx) * a[i] + fx * b[i], lower = (1 - fx) * c[i] + fx * d[i];
            return (1 - fy) * upper + fy * lower;
          };
          const size_t at = (size_t(v) * width + u) * top;
          uint16_t* const ids = &image.class_id[at];
          float* const p = &image.probability[at];
          int kept = 0;
          for (const int i : possible) {
            const float value = interpolated(i);
            int place = kept;
            while (place > 0 && value > p[place - 1]) --place;
            if (place == top) continue;
            kept = std::min(kept + 1, top);
            for (int j = kept - 1; j > place; --j) p[j] = p[j - 1], ids[j] = ids[j - 1];
            p[place] = value, ids[place] = uint16_t(i);
          }
        }
    }
  }
  return image;
}

}  // namespace felt
