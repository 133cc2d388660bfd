#include "inference/batch/mixture.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <vector>

#include "core/simd.h"
#include "inference/batch/distinct.h"
#include "inference/batch/mixture_kernels.h"

namespace felt {
namespace {

// Voxels of one task: four blocks of a map. Equal states are found within a task.
constexpr size_t kTaskVoxels = 2048;

void run_kernel(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading,
                std::vector<float>& scratch) {
  if (simd_scalar_forced()) return mixture_kernel_scalar(batch, begin, end, reading);
  mixture_kernel_simd(batch, begin, end, reading, scratch);
  for (size_t voxel = begin; voxel < end; ++voxel)
    if (batch.updated[voxel] == kNeedsF64) mixture_kernel_scalar(batch, voxel, voxel + 1, reading);
}

/// Every state plane, concentrations first.
std::vector<float*> state_planes(std::span<const MixturePlanes> classes) {
  std::vector<float*> planes;
  for (const MixturePlanes& p : classes) planes.push_back(p.a);
  for (const MixturePlanes& p : classes)
    if (p.tau != nullptr) planes.insert(planes.end(), {p.tau, p.kappa, p.beta, p.gamma});
  return planes;
}

/// States gathered from a batch into planes of their own, padded to whole vectors.
class GatheredStates {
public:
  GatheredStates(const MixtureBatch& from, std::span<const uint32_t> voxels)
      : size_(voxels.size()), padded_((size_ + kBatchLanes - 1) / kBatchLanes * kBatchLanes) {
    const std::vector<float*> planes = state_planes(from.classes);
    const size_t k = from.classes.size();
    values_.resize((planes.size() + k + 1) * padded_);
    float* next = values_.data();
    for (const float* plane : planes) {
      for (size_t i = 0; i < padded_; ++i) next[i] = plane[voxels[std::min(i, size_ - 1)]];
      next += padded_;
    }
    classes_.assign(from.classes.begin(), from.classes.end());
    float* at = values_.data();
    const auto take = [&] { return std::exchange(at, at + padded_); };
    for (MixturePlanes& p : classes_) p.a = take();
    for (MixturePlanes& p : classes_) {
      if (p.tau == nullptr) continue;
      for (float** plane : {&p.tau, &p.kappa, &p.beta, &p.gamma}) *plane = take();
    }
    for (MixturePlanes& p : classes_) p.responsibility = p.responsibility != nullptr ? take() : nullptr;
    updated_.resize(padded_);
    batch_ = {padded_, classes_, nullptr, from.log_evidence != nullptr ? take() : nullptr, updated_.data()};
  }

  const MixtureBatch& batch() const { return batch_; }

  /// State i to one voxel of `to`.
  void scatter(size_t i, const MixtureBatch& to, size_t voxel) const {
    to.updated[voxel] = updated_[i];
    if (updated_[i] != kUpdated) return;
    for (size_t c = 0; c < classes_.size(); ++c) {
      const MixturePlanes &from = classes_[c], &p = to.classes[c];
      p.a[voxel] = from.a[i];
      if (p.responsibility != nullptr) p.responsibility[voxel] = from.responsibility[i];
      if (p.tau == nullptr) continue;
      p.tau[voxel] = from.tau[i];
      p.kappa[voxel] = from.kappa[i];
      p.beta[voxel] = from.beta[i];
      p.gamma[voxel] = from.gamma[i];
    }
    if (to.log_evidence != nullptr) to.log_evidence[voxel] = batch_.log_evidence[i];
  }

private:
  size_t size_, padded_;
  std::vector<float> values_;
  std::vector<MixturePlanes> classes_;
  std::vector<uint8_t> updated_;
  MixtureBatch batch_;
};

void update_gathered(const MixtureBatch& batch, std::span<const uint32_t> first, std::span<const uint32_t> voxels,
                     std::span<const uint32_t> state_of, const MixtureReading& reading, std::vector<float>& scratch) {
  const GatheredStates states(batch, first);
  run_kernel(states.batch(), 0, states.batch().n, reading, scratch);
  for (size_t i = 0; i < voxels.size(); ++i) states.scatter(state_of[i], batch, voxels[i]);
}

/// One task; `batch.updated` is given and zero.
BatchCounts update_task(const MixtureBatch& batch, const MixtureReading& reading, std::vector<float>& scratch) {
  std::vector<uint32_t> voxels;
  for (size_t v = 0; v < batch.n; ++v)
    if (batch.selected == nullptr || batch.selected[v] != 0) voxels.push_back(uint32_t(v));
  if (voxels.empty()) return {};

  const std::vector<float*> planes = state_planes(batch.classes);
  const std::vector<const float*> readable(planes.begin(), planes.end());
  // Gathering and scattering costs about a tenth of an update.
  DistinctStates distinct = distinct_states(readable, batch.n, voxels, voxels.size() * 3 / 4 + 1);
  BatchCounts counts;
  if (!distinct.first.empty()) {
    update_gathered(batch, distinct.first, voxels, distinct.state_of, reading, scratch);
    counts.computed = distinct.first.size();
  } else {
    // Whole vectors in place where everything is selected, the rest gathered.
    const size_t whole = voxels.size() == batch.n ? batch.n / kBatchLanes * kBatchLanes : 0;
    run_kernel(batch, 0, whole, reading, scratch);
    const auto rest = std::span<const uint32_t>(voxels).subspan(whole);
    std::vector<uint32_t> each(rest.size());
    std::iota(each.begin(), each.end(), 0u);
    if (!rest.empty()) update_gathered(batch, rest, rest, each, reading, scratch);
    counts.computed = voxels.size();
  }
  for (uint32_t v : voxels) counts.updated += batch.updated[v] == kUpdated;
  counts.refused = voxels.size() - counts.updated;
  return counts;
}

/// Voxels [begin, end) of `batch` as a batch of its own.
MixtureBatch slice(const MixtureBatch& batch, size_t begin, size_t end, std::vector<MixturePlanes>& classes) {
  const auto offset = [begin](auto* p) { return p != nullptr ? p + begin : nullptr; };
  classes.clear();
  for (const MixturePlanes& p : batch.classes) {
    classes.push_back({offset(p.a), offset(p.tau), offset(p.kappa), offset(p.beta), offset(p.gamma), p.tau_origin,
                       offset(p.responsibility)});
  }
  return {end - begin, classes, offset(batch.selected), offset(batch.log_evidence), offset(batch.updated)};
}

struct Task {
  const MixtureBatch* batch;
  size_t begin, end;
};

BatchCounts run(const Task& task, const MixtureReading& reading) {
  std::vector<MixturePlanes> classes;
  std::vector<float> scratch;
  MixtureBatch part = slice(*task.batch, task.begin, task.end, classes);
  std::vector<uint8_t> updated(part.updated == nullptr ? part.n : 0);
  if (part.updated == nullptr) part.updated = updated.data();
  std::fill_n(part.updated, part.n, uint8_t(0));
  const bool possible = std::isfinite(reading.psi) &&
                        std::any_of(classes.begin(), classes.end(), [](const auto& p) { return p.tau != nullptr; });
  if (possible) return update_task(part, reading, scratch);
  BatchCounts counts;
  for (size_t v = 0; v < part.n; ++v) counts.refused += part.selected == nullptr || part.selected[v] != 0;
  return counts;
}

}  // namespace

BatchCounts update_mixture(std::span<const MixtureBatch> batches, double psi, double noise_sd,
                           Projection projection) noexcept {
  const MixtureReading reading{psi, noise_sd, projection};
  std::vector<Task> tasks;
  for (const MixtureBatch& batch : batches)
    for (size_t begin = 0; begin < batch.n; begin += kTaskVoxels)
      tasks.push_back({&batch, begin, std::min(begin + kTaskVoxels, batch.n)});
  return tbb::parallel_reduce(
      tbb::blocked_range<size_t>(0, tasks.size()), BatchCounts{},
      [&](const tbb::blocked_range<size_t>& range, BatchCounts counts) {
        for (size_t i = range.begin(); i < range.end(); ++i) counts = counts + run(tasks[i], reading);
        return counts;
      },
      std::plus<>());
}

BatchCounts update_mixture(const MixtureBatch& batch, double psi, double noise_sd, Projection projection) noexcept {
  return update_mixture(std::span(&batch, 1), psi, noise_sd, projection);
}

}  // namespace felt
