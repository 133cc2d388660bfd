#include "inference/batch_distinct.h"

#include <bit>

namespace felt {
namespace {

constexpr uint32_t kEmpty = ~0u;

/// Adds the planes to the hash of each voxel. Bitwise: 0 and -0 are different states.
void add_to_hashes(std::span<const float* const> planes, std::span<const uint32_t> voxels,
                   std::vector<uint32_t>& hash) {
  for (const float* plane : planes) {
    for (size_t i = 0; i < voxels.size(); ++i) {
      const uint32_t mixed = (hash[i] ^ std::bit_cast<uint32_t>(plane[voxels[i]])) * 0x9E3779B1u;
      hash[i] = mixed ^ (mixed >> 15);
    }
  }
}

bool equal_states(std::span<const float* const> planes, uint32_t a, uint32_t b) {
  for (const float* plane : planes)
    if (std::bit_cast<uint32_t>(plane[a]) != std::bit_cast<uint32_t>(plane[b])) return false;
  return true;
}

/// Open addressing; `same(i, j)` decides between entries of equal hash.
template <class Same>
bool group(const std::vector<uint32_t>& hash, size_t most_states, std::vector<uint32_t>& first_entry,
           std::vector<uint32_t>& state_of, Same same) {
  std::vector<uint32_t> table(std::bit_ceil(2 * hash.size() + 1), kEmpty);
  const size_t mask = table.size() - 1;
  first_entry.clear();
  for (size_t i = 0; i < hash.size(); ++i) {
    size_t slot = hash[i] & mask;
    while (table[slot] != kEmpty) {
      const size_t j = first_entry[table[slot]];
      if (hash[j] == hash[i] && same(i, j)) break;
      slot = (slot + 1) & mask;
    }
    if (table[slot] == kEmpty) {
      if (first_entry.size() == most_states) return false;
      table[slot] = uint32_t(first_entry.size());
      first_entry.push_back(uint32_t(i));
    }
    state_of[i] = table[slot];
  }
  return true;
}

}  // namespace

DistinctStates distinct_states(std::span<const float* const> planes, std::span<const uint32_t> voxels,
                               size_t most_states) {
  DistinctStates result;
  result.state_of.resize(voxels.size());
  std::vector<uint32_t> hash(voxels.size(), 0), first_entry;
  // Different hashes are different states, so a part of the planes can already show that there are too many.
  const size_t probe = planes.size() / 5;
  add_to_hashes(planes.first(probe), voxels, hash);
  if (!group(hash, most_states, first_entry, result.state_of, [](size_t, size_t) { return true; })) return result;
  add_to_hashes(planes.subspan(probe), voxels, hash);
  const auto same = [&](size_t i, size_t j) { return equal_states(planes, voxels[i], voxels[j]); };
  if (!group(hash, most_states, first_entry, result.state_of, same)) return result;
  for (uint32_t entry : first_entry) result.first.push_back(voxels[entry]);
  return result;
}

}  // namespace felt
