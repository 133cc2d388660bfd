#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace felt {

/// Voxels grouped by equal state.
struct DistinctStates {
  std::vector<uint32_t> first;     ///< of each distinct state the first voxel that has it, in order of appearance
  std::vector<uint32_t> state_of;  ///< of each entry of `voxels`: index into `first`
};

/// Groups `voxels` (indices below `n` into the planes) whose values agree bit for bit in every plane. Exact: hashes
/// only narrow the comparison. Gives up, with `first` empty, as soon as more than `most_states` distinct states are
/// certain; planes that vary most should come first, for that shows in them.
DistinctStates distinct_states(std::span<const float* const> planes, size_t n, std::span<const uint32_t> voxels,
                               size_t most_states);

}  // namespace felt
