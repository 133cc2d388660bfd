#include <vector>

#include "inference/batch/material_kernels.h"
#include "inference/material.h"

namespace felt {

void material_kernel_scalar(const MaterialBatch& states, size_t state, double rho) noexcept {
  std::vector<double> belief;
  std::vector<Nig> prior;
  for (const MaterialPlanes& p : states.classes) {
    belief.push_back(double(p.belief[state]));
    prior.push_back(p.prior);
  }
  const ReadingStatistics readings{double(states.count[state]), double(states.mean[state]) + states.mean_origin,
                                   double(states.m2[state])};
  const MaterialPosterior posterior = material_posterior(belief, prior, readings, rho);
  const MomentMatchedView view = moment_matched_view(posterior, prior, 1);
  for (size_t c = 0; c < prior.size(); ++c) {
    const MaterialPlanes& p = states.classes[c];
    p.a[state] = float(posterior.belief.p[c]);
    if (!has_prior(prior[c])) continue;
    p.tau[state] = float(view.nig[c].tau - p.tau_origin);
    p.kappa[state] = float(view.nig[c].kappa);
    p.beta[state] = float(view.nig[c].beta);
    p.gamma[state] = float(view.nig[c].gamma);
  }
  states.surprise[state] = float(posterior.belief.log_evidence);
}

}  // namespace felt
