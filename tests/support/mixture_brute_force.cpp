#include "tests/support/mixture_brute_force.h"

#include <cmath>
#include <random>

#include "inference/dirichlet.h"
#include "inference/priors.h"

namespace felt::test {

StudentTMixture exact_predictive(std::span<const double> a, std::span<const Nig> prior,
                                 const std::vector<double>& psi) {
  const size_t k = a.size(), n = psi.size(), subsets = size_t(1) << n;
  // Evidence and posterior of each class for each subset of the readings.
  std::vector<std::vector<double>> log_evidence_of(k, std::vector<double>(subsets, 0));
  std::vector<std::vector<Nig>> posterior(k, std::vector<Nig>(subsets));
  for (size_t c = 0; c < k; ++c) {
    posterior[c][0] = prior[c];
    for (size_t s = 1; s < subsets; ++s) {
      size_t last = n - 1;
      while (!(s >> last & 1)) --last;
      const size_t rest = s & ~(size_t(1) << last);
      log_evidence_of[c][s] = log_evidence_of[c][rest] + log_evidence(posterior[c][rest], psi[last]);
      posterior[c][s] = conjugate_update(posterior[c][rest], psi[last]);
    }
  }
  const double total = total_concentration(a);
  std::vector<std::vector<double>> weight(k, std::vector<double>(subsets, 0));
  double sum = 0;
  std::vector<size_t> owner(n, 0), members(k);
  for (bool more = true; more;) {
    std::fill(members.begin(), members.end(), 0);
    double log_weight = 0;
    std::vector<double> count(a.begin(), a.end());
    for (size_t i = 0; i < n; ++i) {
      members[owner[i]] |= size_t(1) << i;
      log_weight += std::log(count[owner[i]]++);  // Polya urn: the Dirichlet-multinomial, up to its constant
    }
    for (size_t c = 0; c < k; ++c) log_weight += log_evidence_of[c][members[c]];
    const double w = std::exp(log_weight);
    sum += w;
    for (size_t c = 0; c < k; ++c) weight[c][members[c]] += w * count[c] / (total + double(n));
    size_t digit = 0;
    while (digit < n && ++owner[digit] == k) owner[digit++] = 0;
    more = digit < n;
  }
  StudentTMixture m;
  for (size_t c = 0; c < k; ++c) {
    for (size_t s = 0; s < subsets; ++s) {
      if (!(weight[c][s] > 1e-12 * sum)) continue;
      m.weight.push_back(weight[c][s] / sum);
      m.component.push_back(predictive(posterior[c][s]));
    }
  }
  return m;
}

namespace {

// KL(p || q) for each q, in nats: in u with x = centre + width sinh(u), so that heavy tails are reached.
std::vector<double> kl_divergences(const StudentTMixture& p, const std::vector<StudentTMixture>& qs) {
  const double centre = location(p);
  double width = 0;
  for (size_t c = 0; c < p.weight.size(); ++c) {
    width += p.weight[c] * (std::sqrt(p.component[c].scale2) + std::abs(p.component[c].location - centre));
  }
  // The trapezoidal rule converges exponentially for such integrands.
  constexpr double kReach = 7, kStep = 0.02;
  std::vector<double> sum(qs.size(), 0);
  for (double u = -kReach; u < kReach; u += kStep) {
    const double x = centre + width * std::sinh(u), density = pdf(p, x);
    if (density == 0) continue;
    for (size_t i = 0; i < qs.size(); ++i) {
      sum[i] += density * (std::log(density) - log_pdf(qs[i], x)) * width * std::cosh(u) * kStep;
    }
  }
  return sum;
}

struct State {
  std::vector<double> a;
  std::vector<Nig> nig;
  bool refused = false;

  void touch(double psi, Projection projection) {
    const MixtureUpdate u = mixture_update(a, nig, psi, 0, projection);
    refused = refused || !u.valid;
    if (!u.valid) return;
    a = u.a;
    nig = u.nig;
  }
};

}  // namespace

std::vector<MixtureSetting> mixture_settings() {
  const auto friction = [](double nu) {
    return std::vector<Nig>{calibrated_prior(0.192, 0.046, nu), calibrated_prior(0.390, 0.071, nu),
                            calibrated_prior(0.543, 0.065, nu)};
  };
  const std::vector<Nig> door{{-20, 1, 3, 30}, {20, 1, 3, 30}};
  const std::vector<double> third{1, 1, 1};
  return {
      {"push or pull doors, 6 touches", {10, 10}, door, {1, 1}, {-35, 40}, {8, 8}, 6, 31},
      {"push or pull doors, 8 touches", {1, 1}, door, {1, 3}, {-25, 25}, {12, 12}, 8, 32},
      {"friction, weak prior, 6 touches",
       {2, 4, 2},
       friction(4),
       third,
       {0.192, 0.390, 0.543},
       {0.046, 0.071, 0.065},
       6,
       33},
      {"friction, strong prior, 6 touches",
       {2, 4, 2},
       friction(50),
       third,
       {0.192, 0.390, 0.543},
       {0.046, 0.071, 0.065},
       6,
       34},
      {"friction, weak prior, 8 touches",
       {1, 1, 1},
       friction(8),
       third,
       {0.192, 0.390, 0.543},
       {0.046, 0.071, 0.065},
       8,
       35},
  };
}

ProjectionErrors projection_errors(const MixtureSetting& setting, int runs) {
  std::mt19937 rng(setting.seed);
  std::discrete_distribution<size_t> draw_class(setting.weight.begin(), setting.weight.end());
  ProjectionErrors errors;
  for (int run = 0; run < runs; ++run) {
    std::vector<double> psi;
    State kl{setting.a, setting.prior}, published = kl;
    for (int i = 0; i < setting.readings; ++i) {
      const size_t c = draw_class(rng);
      psi.push_back(std::normal_distribution<double>(setting.mean[c], setting.sd[c])(rng));
      kl.touch(psi.back(), Projection::kl);
      published.touch(psi.back(), Projection::published);
    }
    const std::vector<double> divergence =
        kl_divergences(exact_predictive(setting.a, setting.prior, psi),
                       {predictive_mixture(kl.a, kl.nig), predictive_mixture(published.a, published.nig)});
    errors.kl.mean_divergence += divergence[0] / runs;
    errors.published.mean_divergence += divergence[1] / runs;
    errors.kl.invalid_runs += kl.refused;
    errors.published.invalid_runs += published.refused;
  }
  return errors;
}

}  // namespace felt::test
