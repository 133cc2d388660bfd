#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "mapping/touch/touch_state.h"

namespace felt {

/// Strongest class of voxels while touches are added to the journal one after another. Voxels that the same `material`
/// touches cover share a label, which is computed when it is first asked for and kept.
class TouchedLabels {
public:
  /// The map's classes, properties and counts must not change meanwhile.
  explicit TouchedLabels(const Map& map);

  /// The journal has a new active touch at this place.
  void insert(uint32_t place);

  struct Answer {
    std::vector<int16_t> label;     ///< by voxel in canonical order, touched or not: -1 without evidence and touches
    std::vector<uint64_t> refused;  ///< by touch (place in the journal): voxels whose state it left as it was
  };
  Answer of(const Region& region);

private:
  const Map& map_;
  Beliefs beliefs_;
  /// What was computed of a group and holds as long as no touch cuts it.
  struct Known {
    Region reach;                ///< of its `material` touches
    std::vector<double> pooled;  ///< belief over that; empty: not asked for yet
    std::optional<int16_t> label;
  };
  Known known_of(const TouchGroup& group) const { return {material_reach(map_, group.touches), {}, std::nullopt}; }

  std::vector<TouchGroup> groups_;
  std::vector<Known> known_;  ///< by group
};

}  // namespace felt
