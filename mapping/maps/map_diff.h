#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "mapping/map.h"

namespace felt {

/// How one channel of two maps differs. A voxel has a value in `tsdf` and `weight` where it was observed, in `color`
/// and `color_count` where it was coloured, in `evidence/<class>` where the class has evidence above its prior, in
/// `touch/<property>/{n,mean,m2}` where touches reached it.
struct ChannelDifference {
  std::string name;
  std::string unit;          ///< of the two differences: "m", "", "grey levels" (of 255), "observations", "counts"
  size_t voxels_only_a = 0;  ///< with a value in the first map only
  size_t voxels_only_b = 0;
  size_t voxels_both = 0;     ///< with a value in both: what the following lines compare
  size_t voxels_changed = 0;  ///< of those, with different values
  double max_difference = 0;  ///< infinite where a value is not finite in one map only
  double mean_difference = 0;
};

struct MapDifference {
  bool same_hash = false;
  std::vector<std::string> settings;  ///< what differs besides values, one line each: sizes, class table, journal
  bool comparable = true;  ///< false where voxels do not coincide: another voxel size; then nothing else is compared
  size_t blocks_only_a = 0, blocks_only_b = 0, blocks_both = 0;
  std::vector<ChannelDifference> channels;
  /// Voxels that both maps label (grid `label`: priors, evidence and touches) whose classes have different names.
  size_t class_flips = 0;
  /// Active touches, by id.
  size_t touches_only_a = 0, touches_only_b = 0, touches_both = 0;
  /// Touches that one journal keeps for `redo` and the other does not know: no difference of any value.
  size_t undone_only_a = 0, undone_only_b = 0;
  size_t regions_changed = 0;        ///< touches of both maps whose regions are not the same voxels
  size_t region_voxels_changed = 0;  ///< voxels that are in one of such two regions only
};

/// Compares two maps channel by channel. Blocks that hold nothing do not count.
MapDifference difference(const Map& a, const Map& b);

/// Whether the maps differ by more than rounding allows: other voxels have values, or a value differs by more than
/// `tolerance` in its own unit, or the voxel size, truncation, classes or touches are others. Frame journals may
/// differ.
bool beyond(const MapDifference& difference, double tolerance);

}  // namespace felt
