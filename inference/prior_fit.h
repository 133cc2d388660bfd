#pragma once

#include <optional>
#include <span>
#include <vector>

#include "inference/nig.h"
#include "inference/priors.h"

namespace felt {

/// Readings of one class, by the group (place, object, session) they were taken at.
using GroupedReadings = std::vector<std::vector<double>>;

/// What the readings of one class say about its prior.
struct PriorFit {
  size_t readings = 0;
  size_t groups = 0;
  double mean = 0;                    ///< of all readings
  double sd = 0;                      ///< of single readings: between and within groups together
  std::optional<double> rho;          ///< intra-class correlation; needs 2 groups and a group with 2 readings
  std::optional<double> assumed_rho;  ///< that of other classes, where all readings come from one group
  double effective_readings = 0;      ///< independent readings that inform the mean as well
  double nu_0 = 0;                    ///< pseudo-count of the prior: effective readings, capped
  double ks_distance = 0;  ///< largest distance of the readings' distribution function from the fitted normal's
  bool normal_is_plausible = false;  ///< ks_distance below Lilliefors' 5 % point, 0.886/sqrt(effective readings)
};

/// One-way analysis of variance (unequal group sizes, method of moments, between-group variance floored at 0). Empty
/// groups are ignored. Empty where there are fewer than two readings or all are equal. One group says nothing of the
/// variance between groups: with `rho_elsewhere` that is taken from it, else its readings count as independent ones.
std::optional<PriorFit> fit_prior(const GroupedReadings& groups, double max_nu_0 = kDefaultPriorReadings,
                                  std::optional<double> rho_elsewhere = std::nullopt);

/// Correlation of a whole property: the classes' values, weighted by their groups less one. Empty where none has one.
std::optional<double> pooled_rho(std::span<const PriorFit> fits);

/// Probability that the best decision between two equally probable classes is wrong after one reading:
/// half the overlap of their predictives. 1/2 where they feel the same.
double confusion_after_one_touch(const Nig& a, const Nig& b);

/// From here on a single touch does not separate two classes.
constexpr double kInseparable = 0.25;

}  // namespace felt
