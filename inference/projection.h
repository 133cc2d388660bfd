#pragma once

#include "inference/nig.h"

namespace felt {

/// How the mixture that a reading leaves behind is brought back to one product of Dirichlet and NIG blocks.
enum class Projection {
  kl,         ///< matches E of the natural statistics: nearest in KL(exact || projected); always valid
  published,  ///< the moment set {mu, lambda, lambda^2, mu^2 lambda, w, w^2} of Ewen et al.; may be no valid prior
};

/// The NIG nearest in KL to r `updated` + not_r `prior`, with r + not_r = 1 (both given, so that neither is lost to
/// rounding near 0). Centred: depends on the locations only through their difference. Always valid.
Nig project_nig_kl(const Nig& prior, const Nig& updated, double r, double not_r);

/// Moments {mu, lambda, lambda^2, mu^2 lambda} of the same mixture, solved as printed with sigma^2 read as the
/// precision. The result depends on the property's origin; kappa may come out negative or infinite: check with
/// `is_valid`. 1/kappa^ is a sum of positive terms and one term of either sign; its rounding error is a few ulp of the
/// largest.
Nig project_nig_published(const Nig& prior, const Nig& updated, double r, double not_r);

}  // namespace felt
