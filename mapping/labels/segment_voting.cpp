#include "mapping/labels/segment_voting.h"

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <vector>

namespace felt {
namespace {

/// Numbers the values of an image that occur, in ascending order.
class Numbering {
public:
  template <typename Values>
  explicit Numbering(const Values& values) : number_(size_t(1) << 16, kAbsent) {
    for (const uint16_t value : values) number_[value] = 0;
    for (size_t value = 0; value < number_.size(); ++value)
      if (number_[value] == 0) {
        number_[value] = int32_t(values_.size());
        values_.push_back(uint16_t(value));
      }
  }
  size_t size() const { return values_.size(); }
  size_t operator()(uint16_t value) const { return size_t(number_[value]); }
  uint16_t value(size_t number) const { return values_[number]; }

private:
  static constexpr int32_t kAbsent = -1;
  std::vector<int32_t> number_;
  std::vector<uint16_t> values_;
};

}  // namespace

void vote_labels(const Image<uint16_t>& segments, double least_share, LabelImage& labels) {
  assert(segments.size() == labels.size());
  const Numbering segment(segments), id(labels);
  const size_t k = id.size();
  std::vector<uint32_t> votes(segment.size() * k, 0);
  for (size_t p = 0; p < labels.size(); ++p)
    if (labels.data()[p] != kNoLabel) ++votes[segment(segments.data()[p]) * k + id(labels.data()[p])];
  std::vector<int32_t> winner(segment.size(), -1);
  for (size_t s = 0; s < segment.size(); ++s) {
    if (segment.value(s) == 0) continue;
    const uint32_t *const begin = &votes[s * k], *const best = std::max_element(begin, begin + k);
    uint64_t all = 0;
    for (size_t i = 0; i < k; ++i) all += begin[i];
    if (*best > 0 && double(*best) >= least_share * double(all)) winner[s] = id.value(size_t(best - begin));
  }
  for (size_t p = 0; p < labels.size(); ++p)
    if (const int32_t won = winner[segment(segments.data()[p])]; won >= 0) labels.data()[p] = uint16_t(won);
}

void pool_probabilities(const Image<uint16_t>& segments, double own_weight, ProbabilityImage& probabilities) {
  assert(segments.size() * size_t(probabilities.top) == probabilities.probability.size());
  const Numbering segment(segments), id(probabilities.class_id);
  const size_t k = id.size(), top = size_t(probabilities.top);
  std::vector<double> sum(segment.size() * k, 0.0);
  std::vector<uint32_t> count(segment.size(), 0);
  for (size_t p = 0; p < segments.size(); ++p) {
    const size_t s = segment(segments.data()[p]);
    double any = 0;
    for (size_t i = p * top; i < (p + 1) * top; ++i) {
      sum[s * k + id(probabilities.class_id[i])] += double(probabilities.probability[i]);
      any += double(probabilities.probability[i]);
    }
    count[s] += any > 0;
  }
  std::vector<float> mixed(k);
  std::vector<uint16_t> order(k);
  const auto keep_greatest = [&](size_t p) {
    const size_t kept = std::min(top, k);
    for (size_t i = 0; i < k; ++i) order[i] = uint16_t(i);
    std::partial_sort(order.begin(), order.begin() + std::ptrdiff_t(kept), order.end(),
                      [&](uint16_t a, uint16_t b) { return mixed[a] != mixed[b] ? mixed[a] > mixed[b] : a < b; });
    for (size_t i = 0; i < top; ++i) {
      probabilities.class_id[p * top + i] = i < kept ? id.value(order[i]) : uint16_t(0);
      probabilities.probability[p * top + i] = i < kept ? mixed[order[i]] : 0.0f;
    }
  };
  // Without a share of its own every pixel of a segment holds the same: sort once a segment.
  std::vector<size_t> first(segment.size(), segments.size());
  for (size_t p = 0; p < segments.size(); ++p) {
    const size_t s = segment(segments.data()[p]);
    if (segment.value(s) == 0 || count[s] == 0) continue;
    if (own_weight == 0 && first[s] < segments.size()) {
      std::copy_n(&probabilities.class_id[first[s] * top], top, &probabilities.class_id[p * top]);
      std::copy_n(&probabilities.probability[first[s] * top], top, &probabilities.probability[p * top]);
      continue;
    }
    float own = 0;
    for (size_t i = p * top; i < (p + 1) * top; ++i) own += probabilities.probability[i];
    const double weight = own > 0 ? own_weight : 0.0;
    for (size_t i = 0; i < k; ++i) mixed[i] = float((1 - weight) * sum[s * k + i] / count[s]);
    for (size_t i = p * top; i < (p + 1) * top; ++i)
      mixed[id(probabilities.class_id[i])] += float(weight) * probabilities.probability[i];
    keep_greatest(p);
    first[s] = p;
  }
}

}  // namespace felt
