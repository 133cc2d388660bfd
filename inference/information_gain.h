#pragma once

#include <span>

#include "inference/student_t.h"

namespace felt {

/// A number from quadrature and how far off it may be (absolute, not below the truth in any tested case; infinite where
/// a component is narrower than 1e-12 of its location, which doubles do not resolve).
struct Estimate {
  double value = 0;
  double error = 0;
};

/// Differential entropy of a mixture, in nats.
Estimate entropy(const StudentTMixture& m);

/// Expected information gain of the next reading about the class, in nats: the mutual information
/// H(mixture) - sum_c p_c H(t_c), with weights p(c) and components the predictives of the classes. Integrated as the
/// expected KL divergence of the class posterior from the class belief, which has no cancellation: the value is in
/// [0, class entropy].
Estimate information_gain(const StudentTMixture& predictive);

}  // namespace felt
