#include "inference/batch_material.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "inference/batch_distinct.h"
#include "inference/material.h"

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

/// Everything of one distinct state except the voxel's own concentration.
struct State {
  MomentMatchedView view;  ///< total concentration 1: `a` is p(class)
  double surprise = 0;
};

State compute(const MaterialBatch& batch, size_t v, std::span<const Nig> prior, double rho) {
  std::vector<double> belief;
  for (const MaterialPlanes& p : batch.classes) belief.push_back(double(p.belief[v]));
  const ReadingStatistics readings{double(batch.count[v]), double(batch.mean[v]) + batch.mean_origin,
                                   double(batch.m2[v])};
  const MaterialPosterior posterior = material_posterior(belief, prior, readings, rho);
  return {moment_matched_view(posterior, prior, 1), posterior.belief.log_evidence};
}

void write(const MaterialBatch& batch, size_t v, const State& state) {
  const double total = double(batch.concentration[v]) + double(batch.count[v]);
  for (size_t c = 0; c < batch.classes.size(); ++c) {
    const MaterialPlanes& p = batch.classes[c];
    p.a[v] = std::max(float(state.view.a[c] * total), std::numeric_limits<float>::min());
    if (p.tau == nullptr) continue;
    p.tau[v] = float(state.view.nig[c].tau - p.tau_origin);
    p.kappa[v] = float(state.view.nig[c].kappa);
    p.beta[v] = float(state.view.nig[c].beta);
    p.gamma[v] = float(state.view.nig[c].gamma);
  }
  if (batch.surprise != nullptr) batch.surprise[v] = float(state.surprise);
}

MaterialCounts view_of(const MaterialBatch& batch, double rho) {
  MaterialCounts counts;
  std::vector<uint32_t> voxels;
  for (size_t v = 0; v < batch.n; ++v) {
    if (batch.count[v] == 0) continue;
    if (is_usable(batch, v)) {
      voxels.push_back(uint32_t(v));
    } else {
      ++counts.refused;
    }
  }
  std::vector<const float*> planes{batch.count, batch.mean, batch.m2};
  std::vector<Nig> prior;
  for (const MaterialPlanes& p : batch.classes) {
    planes.push_back(p.belief);
    prior.push_back(p.prior);
  }
  const DistinctStates distinct = distinct_states(planes, voxels, voxels.size());
  std::vector<State> states;
  for (uint32_t v : distinct.first) states.push_back(compute(batch, v, prior, rho));
  for (size_t i = 0; i < voxels.size(); ++i) write(batch, voxels[i], states[distinct.state_of[i]]);
  counts.updated = voxels.size();
  counts.computed = states.size();
  return counts;
}

MaterialCounts sum(const MaterialCounts& a, const MaterialCounts& b) {
  return {a.updated + b.updated, a.refused + b.refused, a.computed + b.computed};
}

}  // namespace

MaterialCounts material_view(std::span<const MaterialBatch> batches, double rho) noexcept {
  return tbb::parallel_reduce(
      tbb::blocked_range<size_t>(0, batches.size()), MaterialCounts{},
      [&](const tbb::blocked_range<size_t>& range, MaterialCounts counts) {
        for (size_t i = range.begin(); i < range.end(); ++i) counts = sum(counts, view_of(batches[i], rho));
        return counts;
      },
      sum);
}

MaterialCounts material_view(const MaterialBatch& batch, double rho) noexcept {
  return material_view(std::span(&batch, 1), rho);
}

}  // namespace felt
