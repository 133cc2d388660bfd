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
        lanes_(hn::Lanes(F())),
        rows_(scratch),
        noise_variance_(constant(float(std::min(reading.noise_sd * reading.noise_sd, 1e30)))) {}

  HWY_INLINE void update(size_t voxel) {
    read_as_each_class(voxel);
    weigh();
    const V one = constant(1.0f), zero = hn::Zero(F());
    V overlap = zero, cross = zero;
    for (size_t c = 0; c < k_; ++c) {
      const V a = row(kA).load(c), w = row(kWeight).load(c);
      const V r = hn::Mul(w, inv_total_weight_);
      const V not_r = hn::IfThenElse(hn::Eq(w, one), hn::Mul(other_weight_, inv_total_weight_), hn::Sub(one, r));
      row(kWeight).store(r, c);
      row(kNotR).store(not_r, c);
      if (batch_.classes[c].tau != nullptr) project_nig(voxel, c, r, not_r);
      overlap = hn::MulAdd(r, not_r, overlap);
      cross = hn::MulAdd(hn::Add(a, r), hn::Add(hn::Sub(total_, a), not_r), cross);
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
    return {hn::LoadU(F(), p.tau + voxel), hn::LoadU(F(), p.kappa + voxel), hn::LoadU(F(), p.beta + voxel),
            hn::LoadU(F(), p.gamma + voxel)};
  }

  /// psi - tau, exact to the last bit of the stored tau: psi less the origin is split in two floats.
  HWY_INLINE V deviation(size_t c, V tau) const {
    const double psi =
        std::clamp(reading_.psi - batch_.classes[c].tau_origin, -double(kMostLocation), double(kMostLocation));
    const float high = float(psi);
    return hn::Add(hn::Sub(constant(high), tau), constant(float(psi - double(high))));
  }

  /// s = v/(v + noise variance), v = gamma/beta: what a noisy reading counts.
  HWY_INLINE V tempering(const NigVectors& p) const {
    if (reading_.noise_sd == 0) return constant(1.0f);
    return hn::Div(p.gamma, hn::MulAdd(p.beta, noise_variance_, p.gamma));
  }

  HWY_INLINE void read_as_each_class(size_t voxel) {
    const V one = constant(1.0f), half = constant(0.5f);
    total_ = taking_part_ = hn::Zero(F());
    most_ = constant(-3e38f);
    usable_ = hn::Eq(one, one);
    too_noisy_ = hn::Lt(one, one);
    for (size_t c = 0; c < k_; ++c) {
      const V a = hn::LoadU(F(), batch_.classes[c].a + voxel);
      row(kA).store(a, c);
      total_ = hn::Add(total_, a);
      usable_ = hn::And(usable_, is_count(a));
      if (batch_.classes[c].tau == nullptr) continue;
      taking_part_ = hn::Add(taking_part_, a);
      const NigVectors p = load_nig(voxel, c);
      usable_ = hn::And(usable_, is_usable(p));
      const V s = tempering(p);
      too_noisy_ = hn::Or(too_noisy_, hn::Lt(s, constant(0.75f)));  // noise variance above v/3
      const V inv_kappa = hn::Div(one, hn::Add(p.kappa, s));
      const V kept = hn::Mul(p.kappa, hn::Mul(s, inv_kappa));
      const V d = deviation(c, p.tau);
      const V inv_gamma = hn::Div(one, p.gamma);
      const V excess = hn::Min(hn::Mul(hn::Mul(hn::Mul(half, kept), hn::Mul(d, inv_gamma)), d), constant(1e30f));
      const Reciprocals of_beta = reciprocals(p.beta);
      // ln of a Student-t: G(b + 1/2)/G(b) = b/sqrt(b + w); kappa s/(kappa + s) b/gamma is the inverse squared scale.
      const V shape = hn::Div(p.beta, hn::Add(p.beta, half_step_excess(of_beta.of_x_plus_1)));
      const V inv_scale2 = hn::Mul(hn::Mul(p.beta, inv_gamma), hn::Mul(kept, shape));
      const V log_density = hn::NegMulAdd(hn::Add(p.beta, half), log1p_of(excess).log,
                                          hn::Mul(half, log_of(clamp_to(inv_scale2, 1.2e-38f, 3e38f))));
      const V log_weight = hn::Add(log_of(a), log_density);
      most_ = hn::Max(most_, log_weight);
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
    const V one = constant(1.0f), zero = hn::Zero(F());
    V others = zero, largest = zero;
    for (size_t c = 0; c < k_; ++c) {
      const V w = batch_.classes[c].tau == nullptr ? zero : exp_of_negative(hn::Sub(row(kWeight).load(c), most_));
      row(kWeight).store(w, c);
      const M ties = hn::Eq(w, one);
      largest = hn::Add(largest, hn::IfThenElseZero(ties, one));
      others = hn::Add(others, hn::IfThenZeroElse(ties, w));
    }
    other_weight_ = hn::Add(others, hn::Sub(largest, one));
    total_weight_ = hn::Add(one, other_weight_);
    inv_total_weight_ = hn::Div(one, total_weight_);
  }

  HWY_INLINE void project_nig(size_t voxel, size_t c, V r, V not_r) {
    const NigVectors p = load_nig(voxel, c);
    const Reciprocals of_beta{row(kBetaInverse).load(c), row(kBetaT).load(c)};
    const V s = tempering(p), inv_kappa = row(kInvKappa).load(c);
    const NigUpdate u{hn::Mul(constant(0.5f), s), hn::Mul(s, row(kExcess).load(c)), inv_kappa,
                      hn::Mul(hn::Mul(s, deviation(c, p.tau)), inv_kappa)};
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
    const V others = hn::Sub(total_, a), x = hn::Add(a, r);
    const V own = hn::Mul(a, hn::Add(others, not_r));
    const V numerator = hn::MulAdd(others, r, own);
    const V denominator =
        hn::MulAdd(x, hn::Add(others, not_r), hn::Mul(hn::Mul(r, not_r), hn::Add(total_, constant(1.0f))));
    return hn::Sub(hn::Div(hn::Mul(x, numerator), denominator), a);
  }

  HWY_INLINE void write(size_t voxel) const {
    M valid = hn::AndNot(too_noisy_, usable_);
    for (size_t c = 0; c < k_; ++c) {
      const V a = hn::Add(row(kA).load(c), row(kStep).load(c));
      row(kStep).store(reading_.projection == Projection::kl ? clamp_count(a) : a, c);
      valid = hn::And(valid, is_count(row(kStep).load(c)));
      if (batch_.classes[c].tau == nullptr) continue;
      valid =
          hn::And(valid, is_usable({row(kTau).load(c), row(kKappa).load(c), row(kBeta).load(c), row(kGamma).load(c)}));
    }
    for (size_t c = 0; c < k_; ++c) {
      const MixturePlanes& p = batch_.classes[c];
      hn::BlendedStore(row(kStep).load(c), valid, F(), p.a + voxel);
      if (p.responsibility != nullptr) hn::BlendedStore(row(kWeight).load(c), valid, F(), p.responsibility + voxel);
      if (p.tau == nullptr) continue;
      hn::BlendedStore(row(kTau).load(c), valid, F(), p.tau + voxel);
      hn::BlendedStore(row(kKappa).load(c), valid, F(), p.kappa + voxel);
      hn::BlendedStore(row(kBeta).load(c), valid, F(), p.beta + voxel);
      hn::BlendedStore(row(kGamma).load(c), valid, F(), p.gamma + voxel);
    }
    if (batch_.log_evidence != nullptr) {
      const V share = log_of(hn::Div(total_weight_, taking_part_));
      const V log_evidence = hn::Add(hn::Sub(most_, constant(0.5f * std::log(2 * std::numbers::pi_v<float>))), share);
      hn::BlendedStore(log_evidence, valid, F(), batch_.log_evidence + voxel);
    }
    float state[HWY_MAX_BYTES / sizeof(float)];
    const V noisy = hn::IfThenElseZero(hn::And(usable_, too_noisy_), constant(float(kTooNoisy)));
    hn::StoreU(hn::IfThenElse(valid, constant(float(kUpdated)), noisy), F(), state);
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
  for (size_t voxel = begin; voxel < end; voxel += hn::Lanes(F())) tile.update(voxel);
}

size_t MixtureScratch(size_t classes) { return MixtureTile::kRows * classes * hn::Lanes(F()); }

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
