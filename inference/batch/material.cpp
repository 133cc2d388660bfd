#include "inference/batch/material.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <vector>

#include "core/simd.h"
#include "inference/batch/distinct.h"
#include "inference/batch/material_kernels.h"

namespace felt {
namespace {

bool is_mass(float x) { return x >= 0 && x <= std::numeric_limits<float>::max(); }

/// Whether the voxel's numbers can be used; `count` is known to be positive.
bool is_usable(const MaterialBatch& batch, size_t v) {
  if (!is_mass(batch.count[v]) || !is_mass(batch.m2[v]) || !std::isfinite(batch.mean[v])) return false;
  if (!is_mass(batch.concentration[v])) return false;
  bool some = false;
  for (const MaterialPlanes& p : batch.classes) {
    if (!is_mass(p.belief[v])) return false;
    some = some || (p.belief[v] > 0 && has_prior(p.prior));
  }
  return some;
}

/// Distinct states of a batch in planes of their own, padded to whole vectors.
class GatheredStates {
public:
  GatheredStates(const MaterialBatch& from, std::span<const uint32_t> voxels)
      : size_(voxels.size()),
        padded_((size_ + kBatchLanes - 1) / kBatchLanes * kBatchLanes),
        values_((4 + 6 * from.classes.size()) * padded_),
        classes_(from.classes.begin(), from.classes.end()) {
    float* at = values_.data();
    const auto take = [&] { return std::exchange(at, at + padded_); };
    const auto gather = [&](const float* plane) {
      float* own = take();
      for (size_t i = 0; i < padded_; ++i) own[i] = plane[voxels[std::min(i, size_ - 1)]];
      return own;
    };
    batch_ = {padded_, gather(from.count), gather(from.mean), gather(from.m2), from.mean_origin, nullptr, classes_,
              take()};
    for (MaterialPlanes& p : classes_) {
      p.belief = gather(p.belief);
      for (float** plane : {&p.a, &p.tau, &p.kappa, &p.beta, &p.gamma}) *plane = take();
    }
  }

  void compute(double rho, std::vector<float>& scratch) const {
    const bool priors_fit = std::all_of(classes_.begin(), classes_.end(), [](const MaterialPlanes& p) {
      return !has_prior(p.prior) || fits_kernel(p.prior);
    });
    const bool vectors = priors_fit && !simd_scalar_forced();
    if (vectors) material_kernel_simd(batch_, rho, scratch);
    for (size_t i = 0; i < size_; ++i)
      if (!vectors || !fits(i)) material_kernel_scalar(batch_, i, rho);
  }

  /// State i to one voxel of `to`.
  void scatter(size_t i, const MaterialBatch& to, size_t voxel) const {
    const float total = to.concentration[voxel] + to.count[voxel];
    for (size_t c = 0; c < classes_.size(); ++c) {
      const MaterialPlanes &from = classes_[c], &p = to.classes[c];
      p.a[voxel] = std::max(from.a[i] * total, std::numeric_limits<float>::min());
      if (p.tau == nullptr) continue;
      p.tau[voxel] = from.tau[i];
      p.kappa[voxel] = from.kappa[i];
      p.beta[voxel] = from.beta[i];
      p.gamma[voxel] = from.gamma[i];
    }
    if (to.surprise != nullptr) to.surprise[voxel] = batch_.surprise[i];
  }

private:
  bool fits(size_t i) const {
    float most = 0;
    for (const MaterialPlanes& p : classes_)
      if (has_prior(p.prior)) most = std::max(most, p.belief[i]);
    return most >= kLeastScale && most <= kMostScale && batch_.count[i] >= kLeastCount &&
           batch_.count[i] <= kMostCount && std::abs(batch_.mean[i]) <= kMostLocation;
  }

  size_t size_, padded_;
  std::vector<float> values_;
  std::vector<MaterialPlanes> classes_;
  MaterialBatch batch_;
};

BatchCounts view_of(const MaterialBatch& batch, double rho) {
  BatchCounts counts;
  std::vector<uint32_t> voxels;
  for (size_t v = 0; v < batch.n; ++v) {
    if (batch.count[v] == 0) continue;
    if (is_usable(batch, v)) {
      voxels.push_back(uint32_t(v));
    } else {
      ++counts.refused;
    }
  }
  if (voxels.empty()) return counts;
  std::vector<const float*> planes{batch.count, batch.mean, batch.m2};
  for (const MaterialPlanes& p : batch.classes) planes.push_back(p.belief);
  const DistinctStates distinct = distinct_states(planes, batch.n, voxels, voxels.size());
  const GatheredStates states(batch, distinct.first);
  std::vector<float> scratch;
  states.compute(rho, scratch);
  for (size_t i = 0; i < voxels.size(); ++i) states.scatter(distinct.state_of[i], batch, voxels[i]);
  counts.updated = voxels.size();
  counts.computed = distinct.first.size();
  return counts;
}

}  // namespace

BatchCounts material_view(std::span<const MaterialBatch> batches, double rho) noexcept {
  return tbb::parallel_reduce(
      tbb::blocked_range<size_t>(0, batches.size()), BatchCounts{},
      [&](const tbb::blocked_range<size_t>& range, BatchCounts counts) {
        for (size_t i = range.begin(); i < range.end(); ++i) counts = counts + view_of(batches[i], rho);
        return counts;
      },
      std::plus<>());
}

BatchCounts material_view(const MaterialBatch& batch, double rho) noexcept {
  return material_view(std::span(&batch, 1), rho);
}

}  // namespace felt
