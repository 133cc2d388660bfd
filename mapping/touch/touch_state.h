#pragma once

#include <map>
#include <span>
#include <utility>
#include <vector>

#include "inference/material.h"
#include "inference/student_t.h"
#include "mapping/map.h"
#include "mapping/store/touch_journal.h"

namespace felt {

// The state of touched voxels, derived from vision counts and the journal (docs/touch.md). Nothing here is stored in
// the map but the statistics planes; everything else is computed when it is asked for, in touched blocks only.

/// Priors of a property by slot; a class without a prior has none (kappa 0).
std::vector<Nig> nig_priors(const Property& property, const ClassTable& classes);

/// Sum over the region of the Dirichlet concentrations (priors plus counts), over its total, with no class
/// below 1e-6. One sum a block, then blocks in canonical order: the same for any number of threads.
std::vector<double> pooled_belief(const Map& map, const Region& region);

/// Union of the regions of those of these touches that are `material` ones.
Region material_reach(const Map& map, const std::vector<uint32_t>& touches, Region region = {});

/// Indices (into the journal, ascending) of the active touches that cover a voxel.
std::vector<uint32_t> covering_touches(const Map& map, const Index3& voxel);
/// Those that cover more than half of a region: they speak for it as a whole, others for a part of it.
std::vector<uint32_t> covering_touches(const Map& map, const Region& region);
/// How many active touches reach into a region and cover no more than half of it: what is believed of the region as a
/// whole leaves them out.
size_t touches_of_a_part(const Map& map, const Region& region);

/// Whether one of these touches (places in the journal) is a `mixture` one.
bool any_mixture(const Map& map, const std::vector<uint32_t>& touches);

/// What is believed of a voxel, or of a region whose voxels share their touches.
struct Belief {
  std::vector<double> class_probability;      ///< by slot
  std::vector<double> concentration;          ///< Dirichlet of the moment-matched view
  std::vector<std::vector<Nig>> nig;          ///< by property, slot: blocks of the moment-matched view
  std::vector<StudentTMixture> next_reading;  ///< by property: at this place; no weights where no class has a prior
  std::vector<double> log_evidence;           ///< by property: the surprise of its readings, 0 without
  std::vector<double> readings;               ///< by property: how many touches
  uint64_t refused = 0;                       ///< `mixture` readings whose projection was no valid prior
};

/// What the `material` readings of a set of touches say.
struct MaterialState {
  ClassPosterior classes;                     ///< of all properties together
  std::vector<MaterialPosterior> properties;  ///< by property; meaningful where there are readings
  std::vector<double> readings;               ///< by property
};

/// What `mixture` readings start from where `material` readings came first: no class below 1e-6 of the total.
/// One that the property says nothing of, or that the readings ruled out, would have no concentration at all, and a
/// Dirichlet needs one.
void apply_concentration_floor(std::span<double> concentration);

/// Beliefs of a map that does not change meanwhile. Posteriors of equally touched voxels are computed once. Not
/// thread-safe.
class Beliefs {
public:
  explicit Beliefs(const Map& map);

  /// `concentration`: vision only, prior included.
  Belief at(const Index3& voxel);
  /// A region as a whole, under a set of touches (indices into the journal): the class belief is pooled over the union
  /// of the regions of those touches and of `region`.
  Belief of(const Region& region, const std::vector<uint32_t>& touches);

  /// Posterior of the voxels that exactly these touches cover; at least one of them `material`.
  const MaterialState& material(const std::vector<uint32_t>& touches);
  /// The same, not kept; may be asked by several threads at once. `pooled`: the belief pooled over all their regions.
  MaterialState evaluate(std::span<const double> pooled, const std::vector<uint32_t>& touches) const;
  bool has_material(const std::vector<uint32_t>& touches) const;
  /// State of a voxel with these vision concentrations: material readings first, then `mixture` readings one by one.
  Belief assemble(std::vector<double> vision, const MaterialState* material,
                  const std::vector<uint32_t>& touches) const;
  const std::vector<std::vector<Nig>>& priors() const { return priors_; }

private:
  const Map& map_;
  std::vector<std::vector<Nig>> priors_;
  std::map<std::vector<uint32_t>, MaterialState> cache_;
};

/// Voxels that the same active touches cover, with their numbers (into the journal), in canonical order.
struct TouchGroup {
  std::vector<uint32_t> touches;
  Region region;
};
std::vector<TouchGroup> touch_groups(const Map& map);

/// Takes a region out of groups, which may leave some of them empty, and returns what each of them had of it, with the
/// group's place; what none had comes last, with the place behind them. No returned region is empty.
std::vector<std::pair<size_t, Region>> taken_out(std::vector<TouchGroup>& groups, const Region& region);

}  // namespace felt
