#include <algorithm>
#include <cmath>
#include <vector>

#include "inference/batch/mixture_kernels.h"
#include "inference/mixture.h"

namespace felt {
namespace {

bool in_range(double x, double least, double most) { return x >= least && x <= most; }
bool is_count(double x) { return in_range(x, double(kLeastCount), double(kMostCount)); }

/// `p` with tau less the class's origin.
bool is_usable(const Nig& p) {
  return is_count(p.kappa) && is_count(p.beta) && in_range(p.gamma, double(kLeastScale), double(kMostScale)) &&
         std::abs(p.tau) <= double(kMostLocation);
}

double clamp_count(double x) { return std::clamp(x, double(kLeastCount), double(kMostCount)); }

Nig clamped(const Nig& p) {
  return {std::clamp(p.tau, -double(kMostLocation), double(kMostLocation)), clamp_count(p.kappa), clamp_count(p.beta),
          std::clamp(p.gamma, double(kLeastScale), double(kMostScale))};
}

bool update_voxel(const MixtureBatch& batch, size_t voxel, const MixtureReading& reading) {
  const size_t k = batch.classes.size();
  std::vector<double> a(k);
  std::vector<Nig> prior(k);
  for (size_t c = 0; c < k; ++c) {
    const MixturePlanes& p = batch.classes[c];
    a[c] = double(p.a[voxel]);
    if (!is_count(a[c])) return false;
    if (p.tau == nullptr) continue;
    prior[c] = {double(p.tau[voxel]), double(p.kappa[voxel]), double(p.beta[voxel]), double(p.gamma[voxel])};
    if (!is_usable(prior[c])) return false;
    prior[c].tau += p.tau_origin;
  }
  MixtureUpdate update = mixture_update(a, prior, reading.psi, reading.noise_sd, reading.projection);
  for (size_t c = 0; c < k; ++c) {
    const bool has_planes = batch.classes[c].tau != nullptr;
    update.nig[c].tau -= batch.classes[c].tau_origin;
    if (reading.projection == Projection::kl) {
      update.a[c] = clamp_count(update.a[c]);
      if (has_planes) update.nig[c] = clamped(update.nig[c]);
    }
    if (!is_count(update.a[c]) || (has_planes && !is_usable(update.nig[c]))) return false;
  }
  for (size_t c = 0; c < k; ++c) {
    const MixturePlanes& p = batch.classes[c];
    p.a[voxel] = float(update.a[c]);
    if (p.responsibility != nullptr) p.responsibility[voxel] = float(update.responsibility.p[c]);
    if (p.tau == nullptr) continue;
    p.tau[voxel] = float(update.nig[c].tau);
    p.kappa[voxel] = float(update.nig[c].kappa);
    p.beta[voxel] = float(update.nig[c].beta);
    p.gamma[voxel] = float(update.nig[c].gamma);
  }
  if (batch.log_evidence != nullptr) batch.log_evidence[voxel] = float(update.responsibility.log_evidence);
  return true;
}

}  // namespace

void mixture_kernel_scalar(const MixtureBatch& batch, size_t begin, size_t end,
                           const MixtureReading& reading) noexcept {
  for (size_t voxel = begin; voxel < end; ++voxel)
    batch.updated[voxel] = update_voxel(batch, voxel, reading) ? kUpdated : kRefused;
}

}  // namespace felt
