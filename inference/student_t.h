#pragma once

#include <optional>
#include <span>
#include <vector>

namespace felt {

/// Student-t with location in the unit of the property and squared scale in its square; scale2 > 0, dof > 0.
struct StudentT {
  double location = 0;
  double scale2 = 1;
  double dof = 1;
  bool operator==(const StudentT&) const = default;
};

/// Weights sum to 1; a component of weight 0 does not matter to any function below.
struct StudentTMixture {
  std::vector<double> weight;
  std::vector<StudentT> component;
};

/// Which side of the distribution a CVaR averages over.
enum class Tail { lower, upper };

double log_pdf(const StudentT& t, double x);
double log_pdf(const StudentTMixture& m, double x);
double pdf(const StudentT& t, double x);
double pdf(const StudentTMixture& m, double x);

/// P(psi <= x).
double cdf(const StudentT& t, double x);
double cdf(const StudentTMixture& m, double x);

/// Smallest x with P(psi <= x) >= p, for p in (0, 1); empty where p is outside or x is beyond the largest double (heavy
/// tails: below about 0.02 degrees of freedom). The mixture's is bracketed by its components'.
std::optional<double> quantile(const StudentT& t, double p);
std::optional<double> quantile(const StudentTMixture& m, double p);

/// Exists where dof > 1 (every component).
std::optional<double> mean(const StudentT& t);
std::optional<double> mean(const StudentTMixture& m);

/// Exists where dof > 2 (every component).
std::optional<double> variance(const StudentT& t);
std::optional<double> variance(const StudentTMixture& m);

/// Mean of psi over its worst part: E[psi | psi >= q_p] (upper) or E[psi | psi <= q_p] (lower). Exists where dof > 1
/// (every component), p in (0, 1).
std::optional<double> cvar(const StudentT& t, double p, Tail tail);
std::optional<double> cvar(const StudentTMixture& m, double p, Tail tail);

/// Differential entropy in nats; always exists. The mixture's has no closed form: inference/information_gain.h.
double entropy(const StudentT& t);

/// sum w_c location_c: exists where the mean does not, and equals it where it does.
double location(const StudentTMixture& m);

}  // namespace felt
