#include "mapping/map.h"

#define XXH_INLINE_ALL
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>

#include "core/text.h"

namespace felt {
size_t active_voxel_count(const Map& map) {
  size_t n = 0;
  for (const Block& block : map.store.blocks())
    for (const float w : block.geometry->weight) n += w > 0;
  return n;
}

size_t class_bytes(const Map& map) {
  size_t bytes = 0;
  for (const Block& block : map.store.blocks())
    bytes += (block.evidence.size() + (block.even_evidence != nullptr ? 1 : 0)) * sizeof(Plane) +
             block.evidence.capacity() * sizeof(EvidencePlane);
  return bytes;
}

std::string map_hash(const Map& map) {
  // Blocks are hashed in parallel and their digests in canonical order.
  const std::vector<uint32_t> order = map.store.sorted();
  std::vector<XXH128_hash_t> digests(order.size());
  std::vector<uint8_t> holds(order.size(), 0);
  tbb::parallel_for(size_t(0), order.size(), [&](size_t n) {
    const Block& block = map.store[order[n]];
    if (!block.geometry->observed()) return;
    holds[n] = 1;
    XXH3_state_t state;
    XXH3_INITSTATE(&state);
    XXH3_128bits_reset(&state);
    XXH3_128bits_update(&state, &block.coord, sizeof block.coord);
    XXH3_128bits_update(&state, block.geometry, sizeof *block.geometry);
    if (block.color != nullptr) XXH3_128bits_update(&state, block.color, sizeof *block.color);
    for (const EvidencePlane& e : block.evidence) {
      XXH3_128bits_update(&state, &e.slot, sizeof e.slot);
      XXH3_128bits_update(&state, e.counts, sizeof *e.counts);
    }
    // Each with a mark of its own, so that no plane can pass for another.
    if (block.even_evidence != nullptr) {
      constexpr uint16_t kMark = 0xfffe;
      XXH3_128bits_update(&state, &kMark, sizeof kMark);
      XXH3_128bits_update(&state, block.even_evidence, sizeof *block.even_evidence);
    }
    if (block.instance != nullptr) {
      constexpr uint16_t kMark = 0xfffd;
      XXH3_128bits_update(&state, &kMark, sizeof kMark);
      XXH3_128bits_update(&state, block.instance, sizeof *block.instance);
    }
    for (const TouchPlanes& t : block.touch) {
      // Planes without a reading (their touches were undone) are as good as none.
      if (std::none_of(t.n->value, t.n->value + kBlockVoxels, [](float count) { return count > 0; })) continue;
      XXH3_128bits_update(&state, &t.property, sizeof t.property);
      for (const Plane* plane : {t.n, t.mean, t.m2}) XXH3_128bits_update(&state, plane, sizeof *plane);
    }
    digests[n] = XXH3_128bits_digest(&state);
  });
  XXH3_state_t all;
  XXH3_INITSTATE(&all);
  XXH3_128bits_reset(&all);
  XXH3_128bits_update(&all, &map.voxel_size_m, sizeof map.voxel_size_m);
  XXH3_128bits_update(&all, &map.truncation_m, sizeof map.truncation_m);
  for (size_t n = 0; n < order.size(); ++n)
    if (holds[n]) XXH3_128bits_update(&all, &digests[n], sizeof digests[n]);
  const std::string touches = journal_digest(map.touches);
  XXH3_128bits_update(&all, touches.data(), touches.size());
  const XXH128_hash_t h = XXH3_128bits_digest(&all);
  return hexadecimal(h.high64) + hexadecimal(h.low64);
}

std::optional<Index3> nearest_voxel(const Map& map, const Eigen::Vector3d& point_m) {
  const Eigen::Vector3d q = point_m / map.voxel_size_m;
  if (!q.allFinite() || q.cwiseAbs().maxCoeff() > 1e9) return std::nullopt;
  return Index3{int32_t(std::lround(q.x())), int32_t(std::lround(q.y())), int32_t(std::lround(q.z()))};
}

std::optional<double> sample_tsdf(const Map& map, const Eigen::Vector3d& point_m) {
  constexpr double kLeastShare = 1e-4;  // a point on a mesh is off its edge by the rounding of floats
  if (!nearest_voxel(map, point_m)) return std::nullopt;
  const Eigen::Vector3d at = point_m / map.voxel_size_m, base = at.array().floor(), within = at - base;
  double sum = 0, total = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3i offset(corner >> 2, corner >> 1 & 1, corner & 1);
    double share = 1;
    for (int axis = 0; axis < 3; ++axis) share *= offset[axis] == 1 ? within[axis] : 1 - within[axis];
    if (share < kLeastShare) continue;
    const Eigen::Vector3i voxel = base.cast<int>() + offset;
    const Index3 index{voxel.x(), voxel.y(), voxel.z()};
    const Block* block = map.store.get(block_of_voxel(index));
    if (block == nullptr || !(block->geometry->weight[offset_in_block(index)] > 0)) return std::nullopt;
    sum += share * double(block->geometry->tsdf[offset_in_block(index)]);
    total += share;
  }
  return sum / total;
}

}  // namespace felt
