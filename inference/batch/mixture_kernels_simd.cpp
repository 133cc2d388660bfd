#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "inference/batch/mixture_kernels_simd.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "inference/batch/dirichlet-inl.h"
#include "inference/batch/math-inl.h"
#include "inference/batch/mixture_kernels.h"
#include "inference/batch/projection-inl.h"
#include "inference/batch/row-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

/// One tile: as many voxels as a vector has lanes, all classes. `kNoisy`: the reading has noise.
template <Projection kProjection, bool kNoisy>
class MixtureTile {
public:
  MixtureTile(const MixtureBatch& batch, const MixtureReading& reading, float* scratch)
      : batch_(batch),
        reading_(reading),
        k_(batch.classes.size()),
        lanes_(pair::lanes()),
        rows_(scratch),
        noise_variance_(constant(float(std::min(reading.noise_sd * reading.noise_sd, 1e30)))) {}

  HWY_INLINE void update(size_t voxel) {
    read_as_each_class(voxel);
    weigh();
    writable_ = pair::AndNot(needs_f64_, usable_);
    all_writable_ = pair::AllTrue(writable_);
    DirichletStart start;
    const DirichletRows rows{row(kA), row(kWeight), row(kNotR), row(kStep), row(kShare), row(kResidual), row(kSlope)};
    for (size_t c = 0; c < k_; ++c) {
      const V a = row(kA).load(c), w = row(kWeight).load(c);
      const V r = weights_.share(w), not_r = weights_.not_share(w);
      row(kWeight).store(r, c);
      row(kNotR).store(not_r, c);
      if (batch_.classes[c].tau != nullptr) project_nig(voxel, c, r, not_r);
      if (kProjection == Projection::published) {
        row(kStep).store(published_step(a, r, not_r), c);
      } else {
        start.add(rows, c, a, r, not_r);
      }
    }
    if (k_ == 1) {
      row(kStep).store(constant(1.0f), 0);
    } else if (kProjection == Projection::kl) {
      project_dirichlet(rows, start, k_, total_, writable_);
    }
    if (kProjection == Projection::published) write_valid_blocks(voxel);
    write(voxel);
  }

private:
  enum : size_t {
    kA,
    kWeight,  // log weight, weight, then responsibility
    kNotR,
    kStep,
    kBetaInverse,
    kExcess,
    kCurve,
    kInvKappa,
    kShare,
    kResidual,
    kSlope,
    kTau,  // from here: `published` alone
    kKappa,
    kBeta,
    kGamma,
    kRows
  };

public:
  static constexpr size_t kMostRows = kRows;

private:
  static constexpr size_t kCacheLine = 64 / sizeof(float);

  HWY_INLINE Row row(size_t which) const { return Row(rows_ + which * k_ * lanes_, lanes_); }

  HWY_INLINE NigVectors load_nig(size_t voxel, size_t c) const {
    const MixturePlanes& p = batch_.classes[c];
    return {pair::LoadU(p.tau + voxel), pair::LoadU(p.kappa + voxel), pair::LoadU(p.beta + voxel),
            pair::LoadU(p.gamma + voxel)};
  }

  /// A map keeps 5 k planes apart: more streams than processors foresee.
  HWY_INLINE void fetch_next(size_t voxel, size_t c) const {
    const MixturePlanes& p = batch_.classes[c];
    for (const float* plane : {p.a, p.tau, p.kappa, p.beta, p.gamma}) {
      if (plane == nullptr) return;
      for (size_t i = 0; i < lanes_; i += kCacheLine) hwy::Prefetch(plane + voxel + lanes_ + i);
    }
  }

  HWY_INLINE void store(V x, float* plane) const {
    if (HWY_LIKELY(all_writable_)) return pair::StoreU(x, plane);
    pair::BlendedStore(x, writable_, plane);
  }

  /// psi - tau, exact to the last bit of the stored tau: psi less the origin is split in two floats.
  HWY_INLINE V deviation(size_t c, V tau) const {
    const double psi =
        std::clamp(reading_.psi - batch_.classes[c].tau_origin, -double(kMostLocation), double(kMostLocation));
    const float high = float(psi);
    return pair::Add(pair::Sub(constant(high), tau), constant(float(psi - double(high))));
  }

  /// s = v/(v + noise variance), v = gamma/beta: what a noisy reading counts.
  HWY_INLINE V tempering(const NigVectors& p) const {
    if (!kNoisy) return constant(1.0f);
    return pair::Div(p.gamma, pair::MulAdd(p.beta, noise_variance_, p.gamma));
  }

  /// needs_quadrature of inference/noise.h, a little early: the f64 path decides again what it takes.
  HWY_INLINE M needs_quadrature(const NigVectors& p, V d) const {
    const V v = pair::Div(p.gamma, p.beta);
    const V predictive = pair::Add(pair::Add(v, pair::Div(v, p.kappa)), noise_variance_);
    const V tail = pair::Add(constant(1.0f), pair::Div(pair::Mul(d, d), predictive));
    const M tail_counts = pair::Lt(v, pair::Mul(pair::Mul(constant(3.001f), noise_variance_), pair::Mul(tail, tail)));
    return pair::Or(tail_counts, pair::Lt(p.beta, constant(1.5f)));
  }

  HWY_INLINE void read_as_each_class(size_t voxel) {
    const V one = constant(1.0f), half = constant(0.5f);
    total_ = taking_part_ = pair::Zero();
    largest_a_ = pair::Zero();
    others_ = SumOfOthers();
    most_ = constant(-3e38f);
    usable_ = pair::Eq(one, one);
    needs_f64_ = pair::Lt(one, one);
    for (size_t c = 0; c < k_; ++c) {
      fetch_next(voxel, c);
      const V a = pair::LoadU(batch_.classes[c].a + voxel);
      row(kA).store(a, c);
      total_ = pair::Add(total_, a);
      if (kProjection == Projection::kl)
        largest_a_ = pair::Max(largest_a_, a);
      else
        others_.add(a);
      usable_ = pair::And(usable_, is_count(a));
      if (batch_.classes[c].tau == nullptr) continue;
      taking_part_ = pair::Add(taking_part_, a);
      const NigVectors p = load_nig(voxel, c);
      usable_ = pair::And(usable_, is_usable(p));
      const Reciprocals of_beta = reciprocals(p.beta);
      // 1/(kappa + s) and beta/(beta + w) from one division; G(b + 1/2)/G(b) = b/sqrt(b + w).
      const V s = tempering(p), kappa_s = pair::Add(p.kappa, s);
      const V beta_w = pair::Add(p.beta, half_step_excess(of_beta.of_x_plus_1));
      const V inv_both = pair::Div(one, pair::Mul(kappa_s, beta_w));
      const V inv_kappa = pair::Mul(beta_w, inv_both);
      const V kept = pair::Mul(p.kappa, pair::Mul(s, inv_kappa));
      const V shape = pair::Mul(p.beta, pair::Mul(kappa_s, inv_both));
      const V d = deviation(c, p.tau);
      if (kNoisy) needs_f64_ = pair::Or(needs_f64_, needs_quadrature(p, d));
      const V inv_gamma = pair::Div(one, p.gamma);
      const V excess =
          pair::Min(pair::Mul(pair::Mul(pair::Mul(half, kept), pair::Mul(d, inv_gamma)), d), constant(1e30f));
      // ln of a times a Student-t; kappa s/(kappa + s) b/gamma is the inverse squared scale.
      const V inv_scale2 = pair::Mul(pair::Mul(p.beta, inv_gamma), pair::Mul(kept, shape));
      const V height = pair::Mul(a, pair::Sqrt(clamp_to(inv_scale2, 1.2e-38f, 3e38f)));
      const Log1p of_excess = log1p_of(excess);
      const V log_weight = pair::NegMulAdd(pair::Add(p.beta, half), of_excess.log, log_of(height));
      most_ = pair::Max(most_, log_weight);
      row(kWeight).store(log_weight, c);
      row(kBetaInverse).store(of_beta.of_x, c);
      row(kExcess).store(excess, c);
      row(kCurve).store(log_curve(of_excess, excess), c);
      row(kInvKappa).store(inv_kappa, c);
    }
    if (kProjection == Projection::kl && k_ > 1)
      needs_f64_ = pair::Or(needs_f64_, pair::Lt(pair::Sub(total_, largest_a_), constant(kLeastOthers)));
  }

  HWY_INLINE void weigh() {
    weights_ = Weights();
    for (size_t c = 0; c < k_; ++c) {
      const bool takes_part = batch_.classes[c].tau != nullptr;
      const V w = takes_part ? exp_of_negative(pair::Sub(row(kWeight).load(c), most_)) : pair::Zero();
      row(kWeight).store(w, c);
      weights_.add(w);
    }
    weights_.close();
  }

  HWY_INLINE void project_nig(size_t voxel, size_t c, V r, V not_r) {
    const NigVectors p = load_nig(voxel, c);
    const V inv_beta = row(kBetaInverse).load(c), inv_kappa = row(kInvKappa).load(c), s = tempering(p);
    NigUpdate u;
    u.beta_step = pair::Mul(constant(0.5f), s);
    u.gain = pair::Mul(u.beta_step, inv_beta);
    u.excess = row(kExcess).load(c);
    u.inv_kappa = inv_kappa;
    u.shift = pair::Mul(pair::Mul(s, deviation(c, p.tau)), inv_kappa);
    u.pull = pair::Mul(pair::Mul(constant(2.0f), pair::Mul(p.beta, s)), pair::Mul(u.excess, inv_kappa));
    // Of a noisy reading's square only the share s is the class's own.
    if (kNoisy) u.excess = pair::Mul(s, u.excess);
    u.curve = kNoisy ? log_curve(log1p_of(u.excess), u.excess) : row(kCurve).load(c);
    if (kProjection == Projection::published) {
      const V origin = constant(float(batch_.classes[c].tau_origin));
      const NigVectors out = project_published(p, origin, inv_beta, u, r, not_r);
      row(kTau).store(out.tau, c);
      row(kKappa).store(out.kappa, c);
      row(kBeta).store(out.beta, c);
      row(kGamma).store(out.gamma, c);
      return;
    }
    const M says = says_something(p, u, r);
    if (pair::AllFalse(says)) return;
    const ShapeTerms shape = kNoisy ? shape_terms(p.beta, u) : half_step_shape_terms(p.beta, inv_beta, u);
    const NigVectors out = project_kl(p, inv_beta, shape, u, r, not_r);
    const MixturePlanes& planes = batch_.classes[c];
    store(pair::IfThenElse(says, out.tau, p.tau), planes.tau + voxel);
    store(pair::IfThenElse(says, out.kappa, p.kappa), planes.kappa + voxel);
    store(pair::IfThenElse(says, out.beta, p.beta), planes.beta + voxel);
    store(pair::IfThenElse(says, out.gamma, p.gamma), planes.gamma + voxel);
  }

  /// a^ - a by E[w] (E[w] - E[w^2])/(E[w^2] - E[w]^2), all sums of positive terms.
  HWY_INLINE V published_step(V a, V r, V not_r) const {
    const V others = others_.others(a), x = pair::Add(a, r);
    const V own = pair::Mul(a, pair::Add(others, not_r));
    const V numerator = pair::MulAdd(others, r, own);
    const V denominator =
        pair::MulAdd(x, pair::Add(others, not_r), pair::Mul(pair::Mul(r, not_r), pair::Add(total_, constant(1.0f))));
    return pair::Sub(pair::Div(pair::Mul(x, numerator), denominator), a);
  }

  /// `published`: a voxel is written only where all of its classes are valid.
  HWY_INLINE void write_valid_blocks(size_t voxel) {
    for (size_t c = 0; c < k_; ++c) {
      writable_ = pair::And(writable_, is_count(pair::Add(row(kA).load(c), row(kStep).load(c))));
      if (batch_.classes[c].tau == nullptr) continue;
      const NigVectors out{row(kTau).load(c), row(kKappa).load(c), row(kBeta).load(c), row(kGamma).load(c)};
      writable_ = pair::And(writable_, is_usable(out));
    }
    all_writable_ = pair::AllTrue(writable_);
    for (size_t c = 0; c < k_; ++c) {
      const MixturePlanes& p = batch_.classes[c];
      if (p.tau == nullptr) continue;
      store(row(kTau).load(c), p.tau + voxel);
      store(row(kKappa).load(c), p.kappa + voxel);
      store(row(kBeta).load(c), p.beta + voxel);
      store(row(kGamma).load(c), p.gamma + voxel);
    }
  }

  /// Concentrations, what was asked for besides, and the verdict.
  HWY_INLINE void write(size_t voxel) const {
    for (size_t c = 0; c < k_; ++c) {
      const MixturePlanes& p = batch_.classes[c];
      const V a = pair::Add(row(kA).load(c), row(kStep).load(c));
      store(kProjection == Projection::kl ? clamp_count(a) : a, p.a + voxel);
      if (p.responsibility != nullptr) store(row(kWeight).load(c), p.responsibility + voxel);
    }
    if (batch_.log_evidence != nullptr) {
      const V share = log_of(pair::Div(weights_.total(), taking_part_));
      const V log_evidence =
          pair::Add(pair::Sub(most_, constant(0.5f * std::log(2 * std::numbers::pi_v<float>))), share);
      store(log_evidence, batch_.log_evidence + voxel);
    }
    if (HWY_LIKELY(all_writable_)) {
      std::fill_n(batch_.updated + voxel, lanes_, uint8_t(kUpdated));
      return;
    }
    float state[2 * HWY_MAX_BYTES / sizeof(float)];
    const V left = pair::IfThenElseZero(pair::And(usable_, needs_f64_), constant(float(kNeedsF64)));
    pair::StoreU(pair::IfThenElse(writable_, constant(float(kUpdated)), left), state);
    for (size_t lane = 0; lane < lanes_; ++lane) batch_.updated[voxel + lane] = uint8_t(state[lane]);
  }

  const MixtureBatch& batch_;
  const MixtureReading& reading_;
  size_t k_, lanes_;
  float* rows_;
  V noise_variance_;
  V total_, taking_part_, most_;  // sum of a; of classes that take part; largest log weight
  V largest_a_;                   // `kl`
  SumOfOthers others_;            // `published`: of a
  Weights weights_;
  M usable_, needs_f64_, writable_;
  bool all_writable_ = false;
};

template <Projection kProjection, bool kNoisy>
void run_tiles(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading, float* scratch) {
  MixtureTile<kProjection, kNoisy> tile(batch, reading, scratch);
  for (size_t voxel = begin; voxel < end; voxel += pair::lanes()) tile.update(voxel);
}

void MixtureKernel(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading, float* scratch) {
  const bool kl = reading.projection == Projection::kl, noisy = reading.noise_sd != 0;
  const auto tiles = kl ? (noisy ? run_tiles<Projection::kl, true> : run_tiles<Projection::kl, false>)
                        : (noisy ? run_tiles<Projection::published, true> : run_tiles<Projection::published, false>);
  tiles(batch, begin, end, reading, scratch);
}

size_t MixtureScratch(size_t classes) {
  return MixtureTile<Projection::published, false>::kMostRows * classes * pair::lanes();
}

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {
HWY_EXPORT(MixtureKernel);
HWY_EXPORT(MixtureScratch);

void mixture_kernel_simd(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading,
                         std::vector<float>& scratch) noexcept {
  scratch.resize(std::max(scratch.size(), HWY_DYNAMIC_DISPATCH(MixtureScratch)(batch.classes.size())));
  HWY_DYNAMIC_DISPATCH(MixtureKernel)(batch, begin, end, reading, scratch.data());
}

}  // namespace felt
#endif
