#include "mapping/touch/property_view.h"

#include <array>
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
  double classes = 0;
  for (const Nig& prior : priors) {
    origin_ += has_prior(prior) ? prior.tau : 0;
    classes += has_prior(prior);
  }
  if (classes > 0) origin_ /= classes;
  for (size_t c = 0; c < priors.size(); ++c) {
    Eigen::Array3d moments = Eigen::Array3d::Zero();
    if (has_prior(priors[c])) {
      const StudentT next = predictive(priors[c]);
      const double first = felt::mean(next).value_or(kNone) - origin_;
      moments = {1, first, variance(next).value_or(kNone) + first * first};
    }
    moments_.push_back(moments);
    prior_ += map.classes.prior(int(c)) * moments;
    even_ += moments / double(priors.size());
  }
}

PropertyEstimate PropertyView::estimate(const Eigen::Array3d& sums) const {
  const double mean = sums[1] / sums[0];
  return {float(origin_ + mean), float(std::sqrt(sums[2] / sums[0] - mean * mean)), false};
}

void PropertyView::copy(const Block& block, float* mean, float* sd) const {
  std::array<double, kBlockVoxels> evidence{};
  std::vector<Eigen::Array3d> sums(kBlockVoxels, prior_);
  for (const EvidencePlane& e : block.evidence)
    for (size_t i = 0; i < kBlockVoxels; ++i) {
      evidence[i] += double(e.counts->value[i]);
      sums[i] += double(e.counts->value[i]) * moments_[e.slot];
    }
  if (block.even_evidence != nullptr)
    for (size_t i = 0; i < kBlockVoxels; ++i) sums[i] += double(block.even_evidence->value[i]) * even_;
  const TouchView* view = view_of(*touched_, block.coord);
  for (size_t i = 0; i < kBlockVoxels; ++i) {
    PropertyEstimate answer{kNoneF, kNoneF, false};
    if (view != nullptr && view->mask.test(int(i)))
      answer = {view->mean[size_t(property_)][i], view->sd[size_t(property_)][i], true};
    else if (evidence[i] > 0 && sums[i][0] > 0)
      answer = estimate(sums[i]);
    mean[i] = answer.mean;
    sd[i] = answer.sd;
  }
}

PropertyEstimate PropertyView::at(const Index3& voxel) const {
  const Block* block = map_.store.get(block_of_voxel(voxel));
  if (block == nullptr) return {kNoneF, kNoneF, false};
  const int i = offset_in_block(voxel);
  if (const TouchView* view = view_of(*touched_, block->coord); view != nullptr && view->mask.test(i))
    return {view->mean[size_t(property_)][size_t(i)], view->sd[size_t(property_)][size_t(i)], true};
  double evidence = 0;
  Eigen::Array3d sums = prior_;
  for (const EvidencePlane& e : block->evidence) {
    evidence += double(e.counts->value[i]);
    sums += double(e.counts->value[i]) * moments_[e.slot];
  }
  if (block->even_evidence != nullptr) sums += double(block->even_evidence->value[i]) * even_;
  return evidence > 0 && sums[0] > 0 ? estimate(sums) : PropertyEstimate{kNoneF, kNoneF, false};
}

}  // namespace felt
