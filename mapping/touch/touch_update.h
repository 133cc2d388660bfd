#pragma once

#include <optional>
#include <vector>

#include "inference/decision.h"
#include "mapping/regions/region_query.h"
#include "mapping/touch/touched_labels.h"

namespace felt {

/// Checks what a reading says against what a map can hold, without looking for its place. Throws TouchError naming what
/// is wrong: an unknown property, a value that is not finite or outside the support, a wrong sigma, stamp or rho, no
/// class with a prior, settings.
void check_reading(const PropertyTable& properties, const ClassTable& classes, const TouchRequest& request);

/// Checks a request against the map and finds its region. `view`: for the rule `mask`. Throws TouchError as
/// check_reading, find_contact and find_region do. The map is not touched.
Touch resolve_touch(const Map& map, const TouchRequest& request, const ViewMask* view = nullptr);

/// Records a touch and brings the statistics planes of its blocks up to date. Returns its id.
uint64_t add_touch(Map& map, Touch touch);

/// What a touch changes.
struct TouchEffect {
  uint64_t id = 0;
  Belief before, after;         ///< of the region as a whole, with all touches that cover the contact
  RegionFlags flags;            ///< of the reading with its noise against `before`
  double tail_probability = 1;  ///< of the reading with its noise under `before`
  std::vector<double> modes;    ///< of the property after: more than one means "this or that"
  uint64_t relabelled = 0;      ///< voxels whose strongest class changed
  uint64_t refused = 0;         ///< voxels that kept their state: the projection was no valid prior
};

/// Records touches one after another, each with a report of what it changed, which is also noted in the journal. What
/// one touch left as it was is not computed again for the next.
class TouchBatch {
public:
  explicit TouchBatch(Map& map) : map_(map) {}
  /// Where it throws (no class has a prior for every property touched here) the journal is as before.
  TouchEffect apply(Touch touch);
  /// Brings the statistics planes of all touched blocks up to date: to be called once, at the end.
  void finish();

private:
  Map& map_;
  std::optional<TouchedLabels> labels_;
  Region touched_;
};

/// A batch of one.
TouchEffect apply_touch(Map& map, Touch touch);

/// Takes a touch out of the map's state, or back into it: exact. Throw TouchError where there is no such touch, or it
/// is undone already (is not undone).
void undo_touch(Map& map, uint64_t id);
void redo_touch(Map& map, uint64_t id);

/// Writes the statistics planes of every block anew from the journal, as after loading or merging.
void rebuild_touch_planes(Map& map);

/// Heap bytes of the statistics planes (only touched blocks have any), and of the journal with its region masks.
size_t touch_plane_bytes(const Map& map);
size_t journal_bytes(const TouchJournal& journal);

}  // namespace felt
