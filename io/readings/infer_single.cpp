#include "io/readings/infer_single.h"

#include <cmath>

#include "core/error.h"
#include "inference/batch/limits.h"
#include "inference/batch/material.h"
#include "inference/batch/mixture.h"
#include "inference/dirichlet.h"

namespace felt {
namespace {

float in_range(double x, float least, float most, const std::string& field, size_t c) {
  if (x >= double(least) && x <= double(most)) return float(x);
  throw FormatError(field + "[" + std::to_string(c) +
                    "]: expected a number that single precision can hold, found one outside");
}

float count(double x, const std::string& field, size_t c) { return in_range(x, kLeastCount, kMostCount, field, c); }

/// tau, kappa, beta, gamma of every class in turn, tau less that of the prior.
std::vector<float> blocks_of(const InferRequest& in) {
  std::vector<float> blocks(4 * in.prior.size(), 0);
  for (size_t c = 0; c < in.prior.size(); ++c) {
    const Nig& p = in.prior[c];
    if (!has_prior(p)) continue;
    blocks[4 * c + 1] = count(p.kappa, "prior.kappa", c);
    blocks[4 * c + 2] = count(p.beta, "prior.beta", c);
    blocks[4 * c + 3] = in_range(p.gamma, kLeastScale, kMostScale, "prior.gamma", c);
  }
  return blocks;
}

std::vector<Nig> nigs_of(const std::vector<float>& blocks, const std::vector<Nig>& prior) {
  std::vector<Nig> nig(prior.size());
  for (size_t c = 0; c < prior.size(); ++c) {
    if (!has_prior(prior[c])) continue;
    const float* b = &blocks[4 * c];
    nig[c] = {prior[c].tau + double(b[0]), double(b[1]), double(b[2]), double(b[3])};
  }
  return nig;
}

std::vector<double> widened(const std::vector<float>& x) { return {x.begin(), x.end()}; }

}  // namespace

MixtureUpdate mixture_update_f32(const InferRequest& in) {
  const size_t k = in.prior.size();
  std::vector<float> blocks = blocks_of(in), a(k), responsibility(k, 0);
  std::vector<MixturePlanes> classes(k);
  for (size_t c = 0; c < k; ++c) {
    a[c] = count(in.a[c], "prior.a", c);
    classes[c].a = &a[c];
    classes[c].responsibility = &responsibility[c];
    if (!has_prior(in.prior[c])) continue;
    float* b = &blocks[4 * c];
    classes[c] = {&a[c], b, b + 1, b + 2, b + 3, in.prior[c].tau, &responsibility[c]};
  }
  float log_evidence = 0;
  uint8_t updated = 0;
  update_mixture({1, classes, nullptr, &log_evidence, &updated}, in.psi[0], in.noise_sd[0], in.projection);
  MixtureUpdate out;
  out.valid = updated == 1;
  out.a = widened(a);
  out.nig = nigs_of(blocks, in.prior);
  if (out.valid) {
    out.responsibility.p = widened(responsibility);
    out.responsibility.log_evidence = double(log_evidence);
  } else {  // the kernel says nothing of a voxel that it leaves alone
    out.responsibility = responsibilities(in.a, in.prior, in.psi[0], in.noise_sd[0]);
  }
  return out;
}

MaterialView material_view_f32(const InferRequest& in) {
  const size_t k = in.prior.size();
  const ReadingStatistics readings = statistics_of(in.psi);
  const double total = total_concentration(in.a);
  const float n = float(readings.n), mean = 0, m2 = float(readings.m2), concentration = float(total);
  std::vector<float> blocks = blocks_of(in), belief(k), a(k);
  std::vector<MaterialPlanes> classes(k);
  for (size_t c = 0; c < k; ++c) {
    belief[c] = count(in.a[c], "prior.alpha", c);
    classes[c].belief = &belief[c];
    classes[c].a = &a[c];
    if (!has_prior(in.prior[c])) continue;
    float* b = &blocks[4 * c];
    classes[c] = {in.prior[c], in.prior[c].tau, &belief[c], &a[c], b, b + 1, b + 2, b + 3};
  }
  float surprise = 0;
  const BatchCounts counts =
      material_view({1, &n, &mean, &m2, readings.mean, &concentration, classes, &surprise}, in.rho);
  if (counts.updated != 1) throw FormatError("psi: expected readings that single precision can hold, found none");
  MaterialView out{widened(a), double(surprise), {widened(a), nigs_of(blocks, in.prior)}};
  for (double& p : out.p) p /= double(concentration + n);
  return out;
}

}  // namespace felt
