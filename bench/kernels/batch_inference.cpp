// One reading applied to 100,000 voxels with eight classes, every voxel its own state, one thread, beside the f64
// update of inference/mixture.h. Everything is inside the timing: responsibilities, NIG and Dirichlet projection, the
// search for equal states. `voxel_classes/s` is the figure; `worst_error` is the largest relative error of the timed
// result against f64 and fails the benchmark above 1e-4. The state is restored before each pass, outside the timing.
#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core/simd.h"
#include "inference/batch_material.h"
#include "inference/batch_mixture.h"
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

/// One region of 100,000 voxels under the same three touches: statistics alike, vision evidence (hence A) not.
void material_region(benchmark::State& state) {
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const std::vector<float> readings(kVoxels, 3), mean(kVoxels, 0.21f), m2(kVoxels, 0.002f), belief(kVoxels, 0.125f);
  std::vector<float> total(kVoxels), out(5 * kClasses * kVoxels);
  for (size_t v = 0; v < kVoxels; ++v) total[v] = 8 + float(v % 97);
  std::vector<MaterialPlanes> classes;
  std::vector<Nig> prior;
  std::vector<double> pooled(kClasses, 0.125);
  for (size_t c = 0; c < kClasses; ++c) {
    float* at = out.data() + 5 * c * kVoxels;
    prior.push_back({kMean[c], 50, 25, 25 * kSd[c] * kSd[c]});
    classes.push_back(
        {prior[c], kMean[c], belief.data(), at, at + kVoxels, at + 2 * kVoxels, at + 3 * kVoxels, at + 4 * kVoxels});
  }
  const MaterialBatch batch{kVoxels, readings.data(), mean.data(), m2.data(), 0, total.data(), classes, nullptr};
  for (auto _ : state) benchmark::DoNotOptimize(material_view(batch, 0.5).computed);
  const ReadingStatistics statistics{3, double(mean[0]), double(m2[0])};
  const MomentMatchedView expected =
      moment_matched_view(material_posterior(pooled, prior, statistics, 0.5), prior, double(total[5]) + 3);
  for (size_t c = 0; c < kClasses; ++c)
    if (std::abs(double(classes[c].a[5]) / expected.a[c] - 1) > 1e-6) state.SkipWithError("not the f64 view");
  count(state, double(kVoxels));
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
  benchmark::RegisterBenchmark("material/one_region", material_region)->Unit(benchmark::kMillisecond);
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
