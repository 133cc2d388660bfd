#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "inference/batch/mixture.h"
#include "inference/nig.h"

namespace felt::test {

/// Owns the planes of a batch: k classes, n voxels, optional outputs all present.
class MixtureStates {
public:
  MixtureStates(size_t k, size_t n)
      : n_(n), values_((6 * k + 1) * n, 0.0f), selected_(n, 1), updated_(n, 7), classes_(k) {
    point();
  }
  MixtureStates(const MixtureStates& other) { *this = other; }
  MixtureStates& operator=(const MixtureStates& other) {
    n_ = other.n_;
    values_ = other.values_;
    selected_ = other.selected_;
    updated_ = other.updated_;
    classes_ = other.classes_;
    point();
    return *this;
  }

  size_t n() const { return n_; }
  size_t k() const { return classes_.size(); }
  std::vector<MixturePlanes>& classes() { return classes_; }
  const std::vector<MixturePlanes>& classes() const { return classes_; }
  std::vector<uint8_t>& selected() { return selected_; }
  const std::vector<uint8_t>& updated() const { return updated_; }
  float log_evidence(size_t v) const { return values_[6 * k() * n_ + v]; }
  const std::vector<float>& values() const { return values_; }

  MixtureBatch batch() { return {n_, classes_, selected_.data(), values_.data() + 6 * k() * n_, updated_.data()}; }

  /// Stores f64 values as the planes do, tau less the class's origin.
  void set(size_t v, size_t c, double a, const Nig& nig) {
    MixturePlanes& p = classes_[c];
    p.a[v] = float(a);
    if (p.tau == nullptr) return;
    p.tau[v] = float(nig.tau - p.tau_origin);
    p.kappa[v] = float(nig.kappa);
    p.beta[v] = float(nig.beta);
    p.gamma[v] = float(nig.gamma);
  }

  Nig nig(size_t v, size_t c) const {
    const MixturePlanes& p = classes_[c];
    if (p.tau == nullptr) return {};
    return {double(p.tau[v]) + p.tau_origin, double(p.kappa[v]), double(p.beta[v]), double(p.gamma[v])};
  }

  std::vector<Nig> nigs(size_t v) const {
    std::vector<Nig> all;
    for (size_t c = 0; c < k(); ++c) all.push_back(nig(v, c));
    return all;
  }

  std::vector<double> concentrations(size_t v) const {
    std::vector<double> all;
    for (const MixturePlanes& p : classes_) all.push_back(double(p.a[v]));
    return all;
  }

  void forget_prior(size_t c) { classes_[c].tau = classes_[c].kappa = classes_[c].beta = classes_[c].gamma = nullptr; }

private:
  void point() {
    float* at = values_.data();
    for (MixturePlanes& p : classes_) {
      const bool had_prior = p.a == nullptr || p.tau != nullptr;
      p = {at, at + n_, at + 2 * n_, at + 3 * n_, at + 4 * n_, p.tau_origin, at + 5 * n_};
      at += 6 * n_;
      if (!had_prior) p.tau = p.kappa = p.beta = p.gamma = nullptr;
    }
  }

  size_t n_ = 0;
  std::vector<float> values_;
  std::vector<uint8_t> selected_, updated_;
  std::vector<MixturePlanes> classes_;
};

inline double log_uniform(std::mt19937& rng, double low, double high) {
  return std::exp(std::uniform_real_distribution<double>(std::log(low), std::log(high))(rng));
}

/// Every voxel its own state around friction-like classes: vision counts 1 to 60, NIG blocks as after a few touches.
inline MixtureStates ordinary_states(size_t k, size_t n, unsigned seed, double location = 0.4, double spread = 0.1) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  MixtureStates states(k, n);
  for (size_t c = 0; c < k; ++c) {
    const double tau = location + spread * normal(rng), kappa = log_uniform(rng, 1, 100);
    const double beta = log_uniform(rng, 1, 100), variance = std::pow(spread * log_uniform(rng, 0.2, 1), 2);
    states.classes()[c].tau_origin = location;
    for (size_t v = 0; v < n; ++v) {
      const double a = 1 + (rng() % 2 == 0 ? double(rng() % 60) : 0) + 0.5 * std::abs(normal(rng));
      states.set(v, c, a,
                 {tau + 0.02 * spread * normal(rng), kappa * log_uniform(rng, 0.9, 1.1),
                  beta * log_uniform(rng, 0.9, 1.1), beta * variance * log_uniform(rng, 0.9, 1.1)});
    }
  }
  return states;
}

/// a from 1e-3 to 1e6, beta from 1e-3 to 1e4, everything else over many decades.
inline MixtureStates extreme_states(size_t k, size_t n, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<double> normal;
  MixtureStates states(k, n);
  for (size_t v = 0; v < n; ++v) {
    for (size_t c = 0; c < k; ++c) {
      const double beta = log_uniform(rng, 1e-3, 1e4);
      states.set(v, c, log_uniform(rng, 1e-3, 1e6),
                 {normal(rng), log_uniform(rng, 1e-2, 1e4), beta, beta * std::pow(log_uniform(rng, 0.01, 2), 2)});
    }
  }
  return states;
}

}  // namespace felt::test
