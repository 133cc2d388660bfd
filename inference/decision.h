#pragma once

#include <span>
#include <vector>

#include "inference/student_t.h"

namespace felt {

/// Entropy of a class belief in nats (0 ln 0 = 0).
double class_entropy(std::span<const double> p);

/// Most probable class; the first of equals.
int most_probable_class(std::span<const double> p);

/// Raises every entry to at least `floor` times the sum and rescales the others, keeping the sum: no class is excluded
/// for good. Needs floor k < 1. Default of the engine: 1e-6.
void apply_belief_floor(std::span<double> belief, double floor);

/// How well a predictive explains a reading psi = (draw) + N(0, noise_sd^2): P(a reading with such noise lies at least
/// as far from its own class's location as psi does), averaged over classes. 1 at the location of a lone class; small
/// where no class explains psi. Relative error with noise below 1e-8.
double tail_probability(const StudentTMixture& predictive, double psi, double noise_sd);

/// Local maxima of a mixture's density, ascending, that matter: higher than `least_height` of the highest, and with a
/// dip to the next higher neighbour below `deepest_ridge` of their own height.
std::vector<double> modes(const StudentTMixture& m, double least_height = 0.05, double deepest_ridge = 0.8);

/// What a reading says about its region, for reports.
struct RegionFlags {
  bool surprising = false;        ///< tail probability below `kSurprising`: no class explains the reading
  bool multi_modal = false;       ///< the predictive had more than one mode that matters
  bool not_one_material = false;  ///< surprising where the class belief is mixed: the region may hold several materials
};
constexpr double kSurprising = 0.01;
/// Class entropy (nats) from which a region counts as mixed: that of two classes at 0.9 and 0.1.
constexpr double kMixedEntropy = 0.325;

/// `predictive`: of the draw behind the reading, before it was known; its weights are the class belief of the region.
/// `noise_sd`: of this reading.
RegionFlags region_flags(const StudentTMixture& predictive, double psi, double noise_sd);

}  // namespace felt
