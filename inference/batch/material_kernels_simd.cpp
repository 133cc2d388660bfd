#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "inference/batch/material_kernels_simd.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "inference/batch/material_kernels.h"
#include "inference/batch/math-inl.h"
#include "inference/batch/projection-inl.h"
#include "inference/batch/row-inl.h"

HWY_BEFORE_NAMESPACE();
namespace felt {
namespace HWY_NAMESPACE {

/// One tile: as many states as a vector has lanes, all classes. The priors are the same in every lane.
class MaterialTile {
public:
  enum : size_t {
    kWeight,  // log weight, then weight
    kExcess,
    kCurve,
    kInvKappa,
    kShift,
    kPull,
    kRows
  };

  MaterialTile(const MaterialBatch& states, double rho, float* scratch)
      : states_(states), k_(states.classes.size()), lanes_(pair::lanes()), rho_(float(rho)), rows_(scratch) {
    // 1 - rho from f64, so that it keeps its digits where rho is close to 1.
    inv_within_ = constant(float(1 / (1 - rho)));
    log_within_ = constant(float(std::log1p(-rho)));
    for (const MaterialPlanes& p : states.classes)
      if (has_prior(p.prior)) reference_gamma_ = std::max(reference_gamma_, p.prior.gamma);
  }

  HWY_INLINE void update(size_t state) {
    const V one = constant(1.0f);
    n_ = pair::LoadU(states_.count + state);
    mean_ = pair::LoadU(states_.mean + state);
    squares_ = pair::Mul(pair::LoadU(states_.m2 + state), inv_within_);
    inflation_ = pair::MulAdd(pair::Sub(n_, one), constant(rho_), one);
    n_effective_ = pair::Div(n_, inflation_);
    half_n_ = pair::Mul(constant(0.5f), n_);
    most_ = constant(kNoPart);
    taking_part_ = pair::Zero();
    for (size_t c = 0; c < k_; ++c) {
      if (has_prior(states_.classes[c].prior)) read_as(state, c);
    }
    weigh();
    for (size_t c = 0; c < k_; ++c) write(state, c);
    write_surprise(state);
  }

private:
  static constexpr float kNoPart = -3e38f;

  HWY_INLINE Row row(size_t which) const { return Row(rows_ + which * k_ * lanes_, lanes_); }

  /// Evidence of the class less what all classes share, and its update.
  HWY_INLINE void read_as(size_t state, size_t c) {
    const MaterialPlanes& planes = states_.classes[c];
    const Nig& p = planes.prior;
    const V one = constant(1.0f), half = constant(0.5f), zero = pair::Zero();
    const V kappa = constant(float(p.kappa)), beta = constant(float(p.beta)), inv_gamma = constant(float(1 / p.gamma));
    const V inv_kappa = pair::Div(one, pair::Add(kappa, n_effective_));
    const V taken = pair::Mul(n_effective_, inv_kappa);  // of the way to the mean
    // mean - tau: the constant in two floats, so that nothing is lost where the property's origin is far.
    const double offset = std::clamp(states_.mean_origin - p.tau, -double(kMostLocation), double(kMostLocation));
    const float high = float(offset);
    const V d = pair::Add(pair::Add(mean_, constant(high)), constant(float(offset - double(high))));
    const V between = pair::Min(
        pair::Mul(pair::Mul(pair::Mul(half, pair::Mul(kappa, taken)), pair::Mul(d, inv_gamma)), d), constant(1e30f));
    const V within = pair::Mul(pair::Mul(half, squares_), inv_gamma);
    const V excess = pair::Min(pair::Add(between, within), constant(1e30f));
    const Log1p of_excess = log1p_of(excess);

    const V beta_n = pair::Add(beta, half_n_);
    const V gammas =
        pair::MulAdd(half_n_, log_of(pair::Add(one, beta_n)), log_gamma_difference_less_log(beta, half_n_));
    const V spread = pair::Mul(half, log1p_of(pair::Mul(n_effective_, constant(float(1 / p.kappa)))).log);
    const V scale = pair::Mul(half_n_, constant(float(std::log(p.gamma / reference_gamma_))));
    const V log_evidence = pair::Sub(pair::NegMulAdd(beta_n, of_excess.log, gammas), pair::Add(spread, scale));
    const V belief = pair::LoadU(planes.belief + state);
    const V log_weight =
        pair::IfThenElse(pair::Gt(belief, zero), pair::Add(log_of(pair::Max(belief, constant(1.2e-38f))), log_evidence),
                         constant(kNoPart));
    taking_part_ = pair::Add(taking_part_, belief);
    most_ = pair::Max(most_, log_weight);
    row(kWeight).store(log_weight, c);
    row(kExcess).store(excess, c);
    row(kCurve).store(log_curve(of_excess, excess), c);
    row(kInvKappa).store(inv_kappa, c);
    row(kShift).store(pair::Mul(taken, d), c);
    row(kPull).store(pair::Mul(pair::Mul(constant(float(2 * p.beta)), taken), between), c);
  }

  HWY_INLINE void weigh() {
    weights_ = Weights();
    for (size_t c = 0; c < k_; ++c) {
      const bool takes_part = has_prior(states_.classes[c].prior);
      const V w = takes_part ? exp_of_negative(pair::Sub(row(kWeight).load(c), most_)) : pair::Zero();
      row(kWeight).store(w, c);
      weights_.add(w);
    }
    weights_.close();
  }

  HWY_INLINE void write(size_t state, size_t c) const {
    const MaterialPlanes& planes = states_.classes[c];
    const Nig& p = planes.prior;
    const V w = row(kWeight).load(c), belief = weights_.share(w);
    pair::StoreU(belief, planes.a + state);
    if (!has_prior(p)) return;
    const V not_belief = weights_.not_share(w);
    const NigVectors prior{constant(float(p.tau - planes.tau_origin)), constant(float(p.kappa)),
                           constant(float(p.beta)), constant(float(p.gamma))};
    const V inv_beta = constant(float(1 / p.beta));
    const NigUpdate u{half_n_,
                      pair::Mul(half_n_, inv_beta),
                      row(kExcess).load(c),
                      row(kCurve).load(c),
                      row(kInvKappa).load(c),
                      row(kShift).load(c),
                      row(kPull).load(c)};
    const M says = says_something(prior, u, belief);
    NigVectors out = prior;
    if (!pair::AllFalse(says)) {
      const NigVectors view = project_kl(prior, inv_beta, shape_terms(prior.beta, u), u, belief, not_belief);
      out = {pair::IfThenElse(says, view.tau, prior.tau), pair::IfThenElse(says, view.kappa, prior.kappa),
             pair::IfThenElse(says, view.beta, prior.beta), pair::IfThenElse(says, view.gamma, prior.gamma)};
    }
    pair::StoreU(out.tau, planes.tau + state);
    pair::StoreU(out.kappa, planes.kappa + state);
    pair::StoreU(out.beta, planes.beta + state);
    pair::StoreU(out.gamma, planes.gamma + state);
  }

  HWY_INLINE void write_surprise(size_t state) const {
    const V one = constant(1.0f), half = constant(0.5f);
    const V shared = pair::MulAdd(pair::Sub(n_, one), log_within_, log_of(inflation_));
    const V scale = constant(float(std::log(2 * std::numbers::pi * reference_gamma_)));
    const V common = pair::Mul(half, pair::MulAdd(n_, scale, shared));
    const V share = log_of(pair::Div(weights_.total(), taking_part_));
    pair::StoreU(pair::Add(pair::Sub(most_, common), share), states_.surprise + state);
  }

  const MaterialBatch& states_;
  size_t k_, lanes_;
  float rho_;
  float* rows_;
  double reference_gamma_ = 0;
  V inv_within_, log_within_;
  V n_, mean_, squares_, inflation_, n_effective_, half_n_;
  V most_, taking_part_;
  Weights weights_;
};

void MaterialKernel(const MaterialBatch& states, double rho, float* scratch) {
  MaterialTile tile(states, rho, scratch);
  for (size_t state = 0; state < states.n; state += pair::lanes()) tile.update(state);
}

size_t MaterialScratch(size_t classes) { return MaterialTile::kRows * classes * pair::lanes(); }

}  // namespace HWY_NAMESPACE
}  // namespace felt
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace felt {
HWY_EXPORT(MaterialKernel);
HWY_EXPORT(MaterialScratch);

void material_kernel_simd(const MaterialBatch& states, double rho, std::vector<float>& scratch) noexcept {
  scratch.resize(std::max(scratch.size(), HWY_DYNAMIC_DISPATCH(MaterialScratch)(states.classes.size())));
  HWY_DYNAMIC_DISPATCH(MaterialKernel)(states, rho, scratch.data());
}

}  // namespace felt
#endif
