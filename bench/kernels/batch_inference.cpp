// The touch models on 100,000 voxels with eight classes, one thread, beside the f64 functions that specify them.
// `mixture`: one reading, every voxel its own state; everything is inside the timing: responsibilities, NIG and
// Dirichlet projection, the search for equal states; the state is restored before each pass, outside. `material`: three
// readings, every voxel its own statistics, or all alike (one region). `voxel_classes/s` is the figure; `worst_error`
// is the largest relative error of the timed result against f64 and fails the benchmark above 1e-4.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core/simd.h"
#include "inference/batch/material.h"
#include "inference/batch/mixture.h"
#include "inference/material.h"
#include "inference/mixture.h"

namespace {
using namespace felt;

constexpr size_t kClasses = 8, kVoxels = 100000;
constexpr double kReading = 0.45;

// Friction, rubber contact: Ewen et al., RSS 2024, Table I.
constexpr double kMean[kClasses] = {.543, .577, .478, .372, .616, .311, .390, .192};
constexpr double kSd[kClasses] = {.065, .077, .133, .055, .048, .045, .071, .046};

class Voxels {
public:
  explicit Voxels(size_t n) : n_(n), values_(5 * kClasses * n), classes_(kClasses) {
    std::mt19937 rng(1);
    std::uniform_real_distribution<float> jitter(0.9f, 1.1f);
    for (size_t c = 0; c < kClasses; ++c) {
      float* at = values_.data() + 5 * c * n;
      classes_[c] = {at, at + n, at + 2 * n, at + 3 * n, at + 4 * n, kMean[c]};
      for (size_t v = 0; v < n; ++v) {
        const float frames = float(rng() % 3 == 0 ? rng() % 50 : 0);
        at[v] = 1 + frames * jitter(rng);
        at[n + v] = float(kSd[c]) * (jitter(rng) - 1);
        at[2 * n + v] = 50 * jitter(rng);
        at[3 * n + v] = 25 * jitter(rng);
        at[4 * n + v] = 25 * float(kSd[c] * kSd[c]) * jitter(rng);
      }
    }
    start_ = values_;
  }

  void restore() { values_ = start_; }
  MixtureBatch batch() const { return {n_, classes_, nullptr, nullptr, nullptr}; }

  /// f64 update of the start state.
  MixtureUpdate exact(size_t v, Projection projection) const {
    std::vector<double> a(kClasses);
    std::vector<Nig> prior(kClasses);
    for (size_t c = 0; c < kClasses; ++c) {
      const float* at = start_.data() + 5 * c * n_ + v;
      a[c] = double(at[0]);
      prior[c] = {double(at[n_]) + kMean[c], double(at[2 * n_]), double(at[3 * n_]), double(at[4 * n_])};
    }
    return mixture_update(a, prior, kReading, 0, projection);
  }

  double worst_error(size_t step, Projection projection) const {
    double worst = 0;
    const auto see = [&](double found, double expected, double unit) {
      const double error = std::abs(found - expected) / unit;
      worst = std::max(worst, std::isfinite(error) ? error : 1e300);
    };
    for (size_t v = 0; v < n_; v += step) {
      const MixtureUpdate x = exact(v, projection);
      if (!x.valid) continue;
      for (size_t c = 0; c < kClasses; ++c) {
        const MixturePlanes& p = classes_[c];
        see(double(p.a[v]), x.a[c], x.a[c]);
        see(double(p.tau[v]) + kMean[c], x.nig[c].tau, std::sqrt(plug_in_variance(x.nig[c])));
        see(double(p.kappa[v]), x.nig[c].kappa, x.nig[c].kappa);
        see(double(p.beta[v]), x.nig[c].beta, x.nig[c].beta);
        see(double(p.gamma[v]), x.nig[c].gamma, x.nig[c].gamma);
      }
    }
    return worst;
  }

private:
  size_t n_;
  std::vector<float> values_, start_;
  std::vector<MixturePlanes> classes_;
};

void count(benchmark::State& state, double voxels) {
  state.counters["voxel_classes/s"] =
      benchmark::Counter(double(kClasses) * voxels, benchmark::Counter::kIsIterationInvariantRate);
}

void batch(benchmark::State& state, const std::string& target, Projection projection, size_t voxels) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  choose_simd(target, "benchmark");
  Voxels work(voxels);
  for (auto _ : state) {
    state.PauseTiming();
    work.restore();
    state.ResumeTiming();
    benchmark::DoNotOptimize(update_mixture(work.batch(), kReading, 0, projection).updated);
  }
  choose_simd("", "benchmark");
  const double worst = work.worst_error(101, projection);
  state.counters["worst_error"] = worst;
  if (projection == Projection::kl && worst > 1e-4) state.SkipWithError("the batch is not the f64 update");
  count(state, double(voxels));
}

void scalar_f64(benchmark::State& state) {
  const Voxels work(1000);
  for (auto _ : state)
    for (size_t v = 0; v < 1000; ++v) benchmark::DoNotOptimize(work.exact(v, Projection::kl).valid);
  count(state, 1000);
}

/// Voxels under three touches each. `alike`: one region, statistics alike and vision evidence (hence A) not; else every
/// voxel its own statistics and belief.
class TouchedVoxels {
public:
  TouchedVoxels(size_t n, bool alike)
      : n_(n),
        readings_(n, 3),
        mean_(n, 0.21f),
        m2_(n, 0.002f),
        total_(n),
        belief_(kClasses * n, 0.125f),
        out_(5 * kClasses * n) {
    std::mt19937 rng(1);
    std::uniform_real_distribution<float> jitter(0.9f, 1.1f);
    for (size_t v = 0; v < n; ++v) {
      total_[v] = 8 + float(v % 97);
      if (alike) continue;
      mean_[v] = 0.45f * jitter(rng);
      m2_[v] *= jitter(rng);
      for (size_t c = 0; c < kClasses; ++c) belief_[c * n + v] *= jitter(rng);
    }
    for (size_t c = 0; c < kClasses; ++c) {
      float* at = out_.data() + 5 * c * n;
      prior_.push_back({kMean[c], 50, 25, 25 * kSd[c] * kSd[c]});
      classes_.push_back({prior_[c], kMean[c], &belief_[c * n], at, at + n, at + 2 * n, at + 3 * n, at + 4 * n});
    }
  }

  MaterialBatch batch() const {
    return {n_, readings_.data(), mean_.data(), m2_.data(), 0, total_.data(), classes_, nullptr};
  }

  MomentMatchedView exact(size_t v) const {
    std::vector<double> belief;
    for (size_t c = 0; c < kClasses; ++c) belief.push_back(double(belief_[c * n_ + v]));
    const ReadingStatistics statistics{3, double(mean_[v]), double(m2_[v])};
    return moment_matched_view(material_posterior(belief, prior_, statistics, 0.5), prior_, double(total_[v]) + 3);
  }

  double worst_error(size_t step) const {
    double worst = 0;
    for (size_t v = 0; v < n_; v += step) {
      const MomentMatchedView x = exact(v);
      for (size_t c = 0; c < kClasses; ++c) {
        const auto see = [&](double found, double expected, double unit) {
          const double error = std::abs(found - expected) / unit;
          worst = std::max(worst, std::isfinite(error) ? error : 1e300);
        };
        const MaterialPlanes& p = classes_[c];
        see(double(p.a[v]), x.a[c], double(total_[v]));
        see(double(p.tau[v]) + kMean[c], x.nig[c].tau, std::sqrt(plug_in_variance(x.nig[c])));
        see(double(p.kappa[v]), x.nig[c].kappa, x.nig[c].kappa);
        see(double(p.beta[v]), x.nig[c].beta, x.nig[c].beta);
        see(double(p.gamma[v]), x.nig[c].gamma, x.nig[c].gamma);
      }
    }
    return worst;
  }

private:
  size_t n_;
  std::vector<float> readings_, mean_, m2_, total_, belief_, out_;
  std::vector<Nig> prior_;
  std::vector<MaterialPlanes> classes_;
};

void material(benchmark::State& state, const std::string& target, size_t voxels, bool alike) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  choose_simd(target, "benchmark");
  const TouchedVoxels work(voxels, alike);
  for (auto _ : state) benchmark::DoNotOptimize(material_view(work.batch(), 0.5).computed);
  choose_simd("", "benchmark");
  const double worst = work.worst_error(101);
  state.counters["worst_error"] = worst;
  if (worst > 1e-4) state.SkipWithError("the batch is not the f64 view");
  count(state, double(voxels));
}

void material_f64(benchmark::State& state) {
  const TouchedVoxels work(1000, false);
  for (auto _ : state)
    for (size_t v = 0; v < 1000; ++v) benchmark::DoNotOptimize(work.exact(v).a[0]);
  count(state, 1000);
}

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  benchmark::RegisterBenchmark("mixture/kl/f64", scalar_f64)->Unit(benchmark::kMillisecond);
  for (const std::string& target : simd_names()) {
    const size_t voxels = target == "scalar" ? 1000 : kVoxels;
    for (const auto& [name, projection] :
         {std::pair{"kl", Projection::kl}, std::pair{"published", Projection::published}}) {
      benchmark::RegisterBenchmark(("mixture/" + std::string(name) + "/f32/" + target).c_str(), batch, target,
                                   projection, voxels)
          ->Unit(benchmark::kMillisecond);
    }
  }
  benchmark::RegisterBenchmark("material/f64", material_f64)->Unit(benchmark::kMillisecond);
  for (const std::string& target : simd_names()) {
    const size_t voxels = target == "scalar" ? 1000 : kVoxels;
    for (const bool alike : {false, true}) {
      const std::string name = std::string("material/") + (alike ? "one_region" : "each_voxel") + "/f32/" + target;
      benchmark::RegisterBenchmark(name.c_str(), material, target, voxels, alike)->Unit(benchmark::kMillisecond);
    }
  }
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
