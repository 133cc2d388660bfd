#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "inference/projection.h"
#include "mapping/store/region.h"
#include "mapping/store/region_settings.h"

namespace felt {

/// What a reading says about its region (docs/touch.md): one material, or each voxel a mixture of its own.
enum class TouchModel { material, mixture };

const char* model_name(TouchModel model);
const char* projection_name(Projection projection);
/// Throw TouchError for unknown names.
TouchModel model_of_name(const std::string& name);
Projection projection_of_name(const std::string& name);

/// A reading of a property at a point, and how it is to be understood. World frame, metres, seconds.
struct TouchRequest {
  double stamp_s = 0;  ///< when; touches are ordered by (stamp, id)
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  std::string property;
  double value = 0;  ///< unit of the property
  double sigma = 0;  ///< sd of the measurement's noise, unit of the property
  TouchModel model = TouchModel::material;
  Projection projection = Projection::kl;
  double rho = std::numeric_limits<double>::quiet_NaN();  ///< NaN: the property's own
  RegionSettings region;
  uint64_t view = 0;  ///< rule `mask`: digest of the mask and its camera, which `resolve_touch` fills in; else 0
};

/// Belief about a region at one moment, for the report of a touch. NaN where a number does not exist.
struct BeliefSummary {
  std::vector<double> class_probability;  ///< by slot
  double class_entropy = 0;               ///< nats
  double mean = 0, sd = 0;                ///< of the next reading in the region, unit of the property
};

/// One touch as the map remembers it.
struct Touch {
  uint64_t id = 0;
  TouchRequest request;
  Index3 voxel;                 ///< where it met the surface
  Eigen::Vector3d surface_m;    ///< the same as a point, world
  Region region;                ///< the voxels it speaks for
  bool undone = false;          ///< kept for `redo`; has no effect on the map
  BeliefSummary before, after;  ///< when it was recorded
  uint64_t refused_voxels = 0;  ///< `mixture`: voxels that kept their state because the projection was no valid prior
};

/// Every touch of a map in canonical order: ascending stamp, then id. The state of touched voxels is a function of this
/// and of the vision counts.
struct TouchJournal {
  std::vector<Touch> touches;

  /// Null where there is none.
  const Touch* find(uint64_t id) const;
  Touch* find(uint64_t id);
  bool any_active() const;
};

/// Inserts in canonical order. The id is a hash of the request (with `view`), so that it does not depend on the order
/// of arrival; a request that came before gets the next free number. Returns the id.
uint64_t insert(TouchJournal& journal, Touch touch);

/// The touches of both journals, whichever comes first: a touch that both hold once, with both regions, and undone only
/// where both say so.
TouchJournal joined(const TouchJournal& a, const TouchJournal& b);

/// 16 hexadecimal digits, and back (throws TouchError).
std::string id_text(uint64_t id);
uint64_t id_of_text(const std::string& text);

/// Digest of the active touches with their region masks, empty where there is none.
std::string journal_digest(const TouchJournal& journal);

}  // namespace felt
