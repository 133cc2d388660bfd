#include "mapping/property_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace felt {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr float kNoneF = std::numeric_limits<float>::quiet_NaN();

}  // namespace

PropertyView::PropertyView(const Map& map, int property, TouchViews touched)
    : map_(map), property_(property), touched_(std::move(touched)) {
  const std::vector<Nig> priors = nig_priors(map.properties[property], map.classes);
  for (const Nig& prior : priors) {
    weight_.push_back(has_prior(prior));
    origin_ += weight_.back() * prior.tau;
    sum_weight_ += weight_.back();
  }
  origin_ = sum_weight_ > 0 ? origin_ / sum_weight_ : 0;
  for (size_t c = 0; c < priors.size(); ++c) {
    const StudentT next = has_prior(priors[c]) ? predictive(priors[c]) : StudentT{origin_, 0, 3};
    first_.push_back(felt::mean(next).value_or(kNone) - origin_);
    second_.push_back(variance(next).value_or(kNone) + first_[c] * first_[c]);
    if (weight_[c] == 0) first_[c] = second_[c] = 0;
    sum_first_ += first_[c];
    sum_second_ += second_[c];
  }
}

void PropertyView::copy(const Block& block, float* mean, float* sd) const {
  if (block.evidence.empty() || sum_weight_ == 0) {
    std::fill_n(mean, kBlockVoxels, kNoneF);
    std::fill_n(sd, kBlockVoxels, kNoneF);
  } else {
    std::array<double, kBlockVoxels> weight, first, second, evidence{};
    weight.fill(sum_weight_);
    first.fill(sum_first_);
    second.fill(sum_second_);
    for (const EvidencePlane& e : block.evidence) {
      const double w = weight_[e.slot], f = first_[e.slot], s = second_[e.slot];
      for (size_t i = 0; i < kBlockVoxels; ++i) {
        const double n = double(e.counts->value[i]);
        evidence[i] += n;
        weight[i] += n * w;
        first[i] += n * f;
        second[i] += n * s;
      }
    }
    for (size_t i = 0; i < kBlockVoxels; ++i) {
      const double m = first[i] / weight[i];
      mean[i] = evidence[i] > 0 ? float(origin_ + m) : kNoneF;
      sd[i] = evidence[i] > 0 ? float(std::sqrt(second[i] / weight[i] - m * m)) : kNoneF;
    }
  }
  if (const TouchView* view = view_of(*touched_, block.coord))
    for_each_bit(view->mask, [&](int i) {
      mean[i] = view->mean[size_t(property_)][size_t(i)];
      sd[i] = view->sd[size_t(property_)][size_t(i)];
    });
}

PropertyEstimate PropertyView::at(const Index3& voxel) const {
  const Block* block = map_.store.get(block_of_voxel(voxel));
  PropertyEstimate estimate{kNoneF, kNoneF, false};
  if (block == nullptr) return estimate;
  const int i = offset_in_block(voxel);
  if (const TouchView* view = view_of(*touched_, block->coord); view != nullptr && view->mask.test(i))
    return {view->mean[size_t(property_)][size_t(i)], view->sd[size_t(property_)][size_t(i)], true};
  double weight = sum_weight_, first = sum_first_, second = sum_second_, evidence = 0;
  for (const EvidencePlane& e : block->evidence) {
    const double n = double(e.counts->value[i]);
    evidence += n;
    weight += n * weight_[e.slot];
    first += n * first_[e.slot];
    second += n * second_[e.slot];
  }
  if (!(evidence > 0) || !(weight > 0)) return estimate;
  const double m = first / weight;
  estimate.mean = float(origin_ + m);
  estimate.sd = float(std::sqrt(second / weight - m * m));
  return estimate;
}

}  // namespace felt
