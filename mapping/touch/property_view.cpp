#include "mapping/touch/property_view.h"

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

PropertyEstimate PropertyView::estimate(const Eigen::Array3d& moments) const {
  const double mean = moments[1] / moments[0];
  return {float(origin_ + mean), float(std::sqrt(moments[2] / moments[0] - mean * mean)), false};
}

template <size_t n>
void PropertyView::gather(const Block& block, int first, std::array<Sums, n>& voxels) const {
  for (Sums& voxel : voxels) voxel.moments = prior_;
  for (const EvidencePlane& e : block.evidence)
    for (size_t i = 0; i < n; ++i) {
      const double count = double(e.counts->value[size_t(first) + i]);
      voxels[i].evidence += count;
      voxels[i].moments += count * moments_[e.slot];
    }
  if (block.even_evidence != nullptr)
    for (size_t i = 0; i < n; ++i) voxels[i].moments += double(block.even_evidence->value[size_t(first) + i]) * even_;
}

PropertyEstimate PropertyView::answer(const TouchView* view, int offset, const Sums& voxel) const {
  const size_t p = size_t(property_), i = size_t(offset);
  if (view != nullptr && view->mask.test(offset)) return {view->mean[p][i], view->sd[p][i], true};
  if (voxel.evidence > 0 && voxel.moments[0] > 0) return estimate(voxel.moments);
  return {kNoneF, kNoneF, false};
}

void PropertyView::copy(const Block& block, float* mean, float* sd) const {
  std::array<Sums, kBlockVoxels> voxels;
  gather(block, 0, voxels);
  const TouchView* view = view_of(*touched_, block.coord);
  for (int i = 0; i < kBlockVoxels; ++i) {
    const PropertyEstimate next = answer(view, i, voxels[size_t(i)]);
    mean[i] = next.mean;
    sd[i] = next.sd;
  }
}

PropertyEstimate PropertyView::at(const Index3& voxel) const {
  const Block* block = map_.store.get(block_of_voxel(voxel));
  if (block == nullptr) return {kNoneF, kNoneF, false};
  const int i = offset_in_block(voxel);
  std::array<Sums, 1> sums;
  gather(*block, i, sums);
  return answer(view_of(*touched_, block->coord), i, sums.front());
}

}  // namespace felt
