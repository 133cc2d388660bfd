#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "inference/batch_mixture_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "inference/batch_dirichlet-inl.h"
#include "inference/batch_math-inl.h"
#include "inference/batch_mixture_kernels.h"
#include "inference/batch_projection-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

/// One tile: as many voxels as a vector has lanes, all classes.
class MixtureTile {
public:
  static constexpr size_t kRows = 18;

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
    const V one = constant(1.0f), zero = pair::Zero();
    V overlap = zero, cross = zero;
    for (size_t c = 0; c < k_; ++c) {
      const V a = row(kA).load(c), w = row(kWeight).load(c);
      const V r = pair::Mul(w, inv_total_weight_);
      const V not_r =
          pair::IfThenElse(pair::Eq(w, one), pair::Mul(other_weight_, inv_total_weight_), pair::Sub(one, r));
      row(kWeight).store(r, c);
      row(kNotR).store(not_r, c);
      if (batch_.classes[c].tau != nullptr) project_nig(voxel, c, r, not_r);
      overlap = pair::MulAdd(r, not_r, overlap);
      cross = pair::MulAdd(pair::Add(a, r), pair::Add(pair::Sub(total_, a), not_r), cross);
      if (reading_.projection == Projection::published) {
        row(kStep).store(published_step(a, r, not_r), c);
      }
    }
    if (k_ == 1) {
      row(kStep).store(one, 0);
    } else if (reading_.projection == Projection::kl) {
      const DirichletRows rows{row(kA),  row(kWeight),   row(kNotR),      row(kStep),     row(kInvA),
                               row(kTA), row(kShiftedA), row(kShareTerm), row(kResidual), row(kSlope)};
      project_dirichlet(rows, k_, total_, overlap, cross, usable_);
    }
    write(voxel);
  }

private:
  enum : size_t {
    kA,
    kWeight,  // log weight, weight, then responsibility
    kNotR,
    kStep,
    kTau,
    kKappa,
    kBeta,
    kGamma,
    kBetaInverse,
    kBetaT,
    kExcess,
    kInvKappa,
    kInvA,
    kTA,
    kShiftedA,
    kShareTerm,
    kResidual,
    kSlope
  };

  HWY_INLINE Row row(size_t which) const { return Row(rows_ + which * k_ * lanes_, lanes_); }

  HWY_INLINE NigVectors load_nig(size_t voxel, size_t c) const {
    const MixturePlanes& p = batch_.classes[c];
    return {pair::LoadU(p.tau + voxel), pair::LoadU(p.kappa + voxel), pair::LoadU(p.beta + voxel),
            pair::LoadU(p.gamma + voxel)};
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
    if (reading_.noise_sd == 0) return constant(1.0f);
    return pair::Div(p.gamma, pair::MulAdd(p.beta, noise_variance_, p.gamma));
  }

  /// needs_quadrature of inference/noise.h, a little early: the f64 path decides again what it takes.
  HWY_INLINE M needs_quadrature(const NigVectors& p, V d) const {
    const V v = pair::Div(p.gamma, p.beta);
    const V predictive = pair::Add(pair::Add(v, pair::Div(v, p.kappa)), noise_variance_);
    const V tail = pair::Add(constant(1.0f), pair::Div(pair::Mul(d, d), predictive));
    return pair::Lt(v, pair::Mul(pair::Mul(constant(3.001f), noise_variance_), pair::Mul(tail, tail)));
  }

  HWY_INLINE void read_as_each_class(size_t voxel) {
    const V one = constant(1.0f), half = constant(0.5f);
    total_ = taking_part_ = pair::Zero();
    most_ = constant(-3e38f);
    usable_ = pair::Eq(one, one);
    too_noisy_ = pair::Lt(one, one);
    for (size_t c = 0; c < k_; ++c) {
      const V a = pair::LoadU(batch_.classes[c].a + voxel);
      row(kA).store(a, c);
      total_ = pair::Add(total_, a);
      usable_ = pair::And(usable_, is_count(a));
      if (batch_.classes[c].tau == nullptr) continue;
      taking_part_ = pair::Add(taking_part_, a);
      const NigVectors p = load_nig(voxel, c);
      usable_ = pair::And(usable_, is_usable(p));
      const V s = tempering(p);
      const V inv_kappa = pair::Div(one, pair::Add(p.kappa, s));
      const V kept = pair::Mul(p.kappa, pair::Mul(s, inv_kappa));
      const V d = deviation(c, p.tau);
      if (reading_.noise_sd != 0) too_noisy_ = pair::Or(too_noisy_, needs_quadrature(p, d));
      const V inv_gamma = pair::Div(one, p.gamma);
      const V excess =
          pair::Min(pair::Mul(pair::Mul(pair::Mul(half, kept), pair::Mul(d, inv_gamma)), d), constant(1e30f));
      const Reciprocals of_beta = reciprocals(p.beta);
      // ln of a Student-t: G(b + 1/2)/G(b) = b/sqrt(b + w); kappa s/(kappa + s) b/gamma is the inverse squared scale.
      const V shape = pair::Div(p.beta, pair::Add(p.beta, half_step_excess(of_beta.of_x_plus_1)));
      const V inv_scale2 = pair::Mul(pair::Mul(p.beta, inv_gamma), pair::Mul(kept, shape));
      const V log_density = pair::NegMulAdd(pair::Add(p.beta, half), log1p_of(excess).log,
                                            pair::Mul(half, log_of(clamp_to(inv_scale2, 1.2e-38f, 3e38f))));
      const V log_weight = pair::Add(log_of(a), log_density);
      most_ = pair::Max(most_, log_weight);
      row(kWeight).store(log_weight, c);
      row(kBetaInverse).store(of_beta.of_x, c);
      row(kBetaT).store(of_beta.of_x_plus_1, c);
      row(kExcess).store(excess, c);
      row(kInvKappa).store(inv_kappa, c);
    }
  }

  /// Weights relative to the largest. What the others weigh together is summed apart, so that 1 - r of the largest
  /// keeps its digits where r is within rounding of 1.
  HWY_INLINE void weigh() {
    const V one = constant(1.0f), zero = pair::Zero();
    V others = zero, largest = zero;
    for (size_t c = 0; c < k_; ++c) {
      const V w = batch_.classes[c].tau == nullptr ? zero : exp_of_negative(pair::Sub(row(kWeight).load(c), most_));
      row(kWeight).store(w, c);
      const M ties = pair::Eq(w, one);
      largest = pair::Add(largest, pair::IfThenElseZero(ties, one));
      others = pair::Add(others, pair::IfThenZeroElse(ties, w));
    }
    other_weight_ = pair::Add(others, pair::Sub(largest, one));
    total_weight_ = pair::Add(one, other_weight_);
    inv_total_weight_ = pair::Div(one, total_weight_);
  }

  HWY_INLINE void project_nig(size_t voxel, size_t c, V r, V not_r) {
    const NigVectors p = load_nig(voxel, c);
    const Reciprocals of_beta{row(kBetaInverse).load(c), row(kBetaT).load(c)};
    const V s = tempering(p), inv_kappa = row(kInvKappa).load(c);
    const NigUpdate u{pair::Mul(constant(0.5f), s), pair::Mul(s, row(kExcess).load(c)), inv_kappa,
                      pair::Mul(pair::Mul(s, deviation(c, p.tau)), inv_kappa)};
    const NigVectors out =
        reading_.projection == Projection::kl
            ? project_kl(p, of_beta, u, r, not_r)
            : project_published(p, constant(float(batch_.classes[c].tau_origin)), of_beta, u, r, not_r);
    row(kTau).store(out.tau, c);
    row(kKappa).store(out.kappa, c);
    row(kBeta).store(out.beta, c);
    row(kGamma).store(out.gamma, c);
  }

  /// a^ - a by E[w] (E[w] - E[w^2])/(E[w^2] - E[w]^2), all sums of positive terms.
  HWY_INLINE V published_step(V a, V r, V not_r) const {
    const V others = pair::Sub(total_, a), x = pair::Add(a, r);
    const V own = pair::Mul(a, pair::Add(others, not_r));
    const V numerator = pair::MulAdd(others, r, own);
    const V denominator =
        pair::MulAdd(x, pair::Add(others, not_r), pair::Mul(pair::Mul(r, not_r), pair::Add(total_, constant(1.0f))));
    return pair::Sub(pair::Div(pair::Mul(x, numerator), denominator), a);
  }

  HWY_INLINE void write(size_t voxel) const {
    M valid = pair::AndNot(too_noisy_, usable_);
    for (size_t c = 0; c < k_; ++c) {
      const V a = pair::Add(row(kA).load(c), row(kStep).load(c));
      row(kStep).store(reading_.projection == Projection::kl ? clamp_count(a) : a, c);
      valid = pair::And(valid, is_count(row(kStep).load(c)));
      if (batch_.classes[c].tau == nullptr) continue;
      valid = pair::And(valid,
                        is_usable({row(kTau).load(c), row(kKappa).load(c), row(kBeta).load(c), row(kGamma).load(c)}));
    }
    for (size_t c = 0; c < k_; ++c) {
      const MixturePlanes& p = batch_.classes[c];
      pair::BlendedStore(row(kStep).load(c), valid, p.a + voxel);
      if (p.responsibility != nullptr) pair::BlendedStore(row(kWeight).load(c), valid, p.responsibility + voxel);
      if (p.tau == nullptr) continue;
      pair::BlendedStore(row(kTau).load(c), valid, p.tau + voxel);
      pair::BlendedStore(row(kKappa).load(c), valid, p.kappa + voxel);
      pair::BlendedStore(row(kBeta).load(c), valid, p.beta + voxel);
      pair::BlendedStore(row(kGamma).load(c), valid, p.gamma + voxel);
    }
    if (batch_.log_evidence != nullptr) {
      const V share = log_of(pair::Div(total_weight_, taking_part_));
      const V log_evidence =
          pair::Add(pair::Sub(most_, constant(0.5f * std::log(2 * std::numbers::pi_v<float>))), share);
      pair::BlendedStore(log_evidence, valid, batch_.log_evidence + voxel);
    }
    float state[2 * HWY_MAX_BYTES / sizeof(float)];
    const V noisy = pair::IfThenElseZero(pair::And(usable_, too_noisy_), constant(float(kTooNoisy)));
    pair::StoreU(pair::IfThenElse(valid, constant(float(kUpdated)), noisy), state);
    for (size_t lane = 0; lane < lanes_; ++lane) batch_.updated[voxel + lane] = uint8_t(state[lane]);
  }

  const MixtureBatch& batch_;
  const MixtureReading& reading_;
  size_t k_, lanes_;
  float* rows_;
  V noise_variance_;
  V total_, taking_part_, most_;  // sum of a; of classes that take part; largest log weight
  V other_weight_, total_weight_, inv_total_weight_;
  M usable_, too_noisy_;
};

void MixtureKernel(const MixtureBatch& batch, size_t begin, size_t end, const MixtureReading& reading, float* scratch) {
  MixtureTile tile(batch, reading, scratch);
  for (size_t voxel = begin; voxel < end; voxel += pair::lanes()) tile.update(voxel);
}

size_t MixtureScratch(size_t classes) { return MixtureTile::kRows * classes * pair::lanes(); }

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
