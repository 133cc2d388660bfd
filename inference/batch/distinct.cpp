#include "inference/batch/distinct.h"

#include <bit>

namespace felt {
namespace {

constexpr uint32_t kEmpty = ~0u;

/// Adds the planes to the hash of each of the first hash.size() voxels. Bitwise: 0 and -0 are different states.
void add_to_hashes(std::span<const float* const> planes, std::span<uint32_t> hash) {
  for (const float* plane : planes) {
    for (size_t v = 0; v < hash.size(); ++v) {
      const uint32_t mixed = (hash[v] ^ std::bit_cast<uint32_t>(plane[v])) * 0x9E3779B1u;
      hash[v] = mixed ^ (mixed >> 15);
    }
  }
}

/// Whether the voxels' hashes certainly have more than `most` different values: counts the slots of a table of bits
/// that they fall into, without a look at which hash came first.
bool certainly_more(std::span<const uint32_t> hash, std::span<const uint32_t> voxels, size_t most) {
  constexpr size_t kWords = 1024;
  uint64_t seen[kWords] = {};
  size_t slots = 0;
  for (uint32_t v : voxels) {
    uint64_t& word = seen[(hash[v] >> 6) % kWords];
    const uint64_t bit = uint64_t(1) << (hash[v] & 63);
    slots += (word & bit) == 0;
    word |= bit;
  }
  return slots > most;
}

bool equal_states(std::span<const float* const> planes, uint32_t a, uint32_t b) {
  for (const float* plane : planes)
    if (std::bit_cast<uint32_t>(plane[a]) != std::bit_cast<uint32_t>(plane[b])) return false;
  return true;
}

}  // namespace

DistinctStates distinct_states(std::span<const float* const> planes, size_t n, std::span<const uint32_t> voxels,
                               size_t most_states) {
  DistinctStates result;
  std::vector<uint32_t> hash(n, 0);
  // Different hashes are different states, so a part of the planes can already show that there are too many.
  const size_t probe = planes.size() / 5;
  add_to_hashes(planes.first(probe), hash);
  if (certainly_more(hash, voxels, most_states)) return result;
  add_to_hashes(planes.subspan(probe), hash);

  // Open addressing. table: index into result.first.
  std::vector<uint32_t> table(std::bit_ceil(2 * voxels.size() + 1), kEmpty);
  const size_t mask = table.size() - 1;
  result.state_of.resize(voxels.size());
  for (size_t i = 0; i < voxels.size(); ++i) {
    const uint32_t voxel = voxels[i];
    size_t slot = hash[voxel] & mask;
    while (table[slot] != kEmpty) {
      const uint32_t first = result.first[table[slot]];
      if (hash[first] == hash[voxel] && equal_states(planes, first, voxel)) break;
      slot = (slot + 1) & mask;
    }
    if (table[slot] == kEmpty) {
      if (result.first.size() == most_states) return {};
      table[slot] = uint32_t(result.first.size());
      result.first.push_back(voxel);
    }
    result.state_of[i] = table[slot];
  }
  return result;
}

}  // namespace felt
