#include "mapping/maps/crop.h"

#include "mapping/grids/leaf_mask.h"
#include "mapping/touch/touch_update.h"
#include "mapping/touch/voxel_beliefs.h"

namespace felt {
namespace {

Eigen::Vector3d center_m(const Map& map, const BlockCoord& coord, int offset) {
  const Index3 v = voxel_at(coord, offset);
  return Eigen::Vector3d(v.x, v.y, v.z) * map.voxel_size_m;
}

/// The observed voxels, as block and offset, for which `inside` holds.
template <typename Inside>
Region observed_where(const Map& map, const Inside& inside) {
  Region region;
  for (const uint32_t number : map.store.sorted()) {
    const Block& block = map.store[number];
    BlockMask mask;
    for_each_bit(observed_voxels(block), [&](int i) {
      if (inside(VoxelRef{number, uint16_t(i)})) mask.set(i);
    });
    if (mask.any()) region.append(block.coord, mask);
  }
  return region;
}

void copy_observed(const Block& from, const BlockMask& inside, BlockStore& store, Block& to) {
  for (int i = 0; i < kBlockVoxels; ++i) {
    if (!inside.test(i)) continue;
    to.geometry->tsdf[i] = from.geometry->tsdf[i];
    to.geometry->weight[i] = from.geometry->weight[i];
  }
  if (from.color != nullptr) {
    ColorPlanes& color = store.add_color(to);
    for (int i = 0; i < kBlockVoxels; ++i) {
      if (!inside.test(i)) continue;
      color.r[i] = from.color->r[i], color.g[i] = from.color->g[i], color.b[i] = from.color->b[i];
      color.count[i] = from.color->count[i];
    }
  }
  const auto copied = [&](const Plane& plane) {
    Plane* copy = store.new_plane();
    for (int i = 0; i < kBlockVoxels; ++i)
      if (inside.test(i)) copy->value[i] = plane.value[i];
    return copy;
  };
  for (const EvidencePlane& evidence : from.evidence) to.evidence.push_back({evidence.slot, copied(*evidence.counts)});
  if (from.even_evidence != nullptr) to.even_evidence = copied(*from.even_evidence);
  if (from.instance != nullptr) {
    InstancePlanes& instance = store.add_instance(to);
    for (int i = 0; i < kBlockVoxels; ++i)
      if (inside.test(i)) instance.id[i] = from.instance->id[i], instance.votes[i] = from.instance->votes[i];
  }
}

}  // namespace

Region voxels_in(const Map& map, const Eigen::AlignedBox3d& box_m) {
  // Bounds that were written as decimals and centres that are multiples of the voxel size differ in their last bits.
  const Eigen::Vector3d rounding = Eigen::Vector3d::Constant(1e-6 * map.voxel_size_m);
  const Eigen::AlignedBox3d reach(box_m.min() - rounding, box_m.max() + rounding);
  return observed_where(map, [&](const VoxelRef& voxel) {
    return reach.contains(center_m(map, map.store[voxel.block].coord, voxel.offset));
  });
}

Region voxels_of_class(const Map& map, int slot) {
  const VoxelBeliefs beliefs(map);
  return observed_where(map, [&](const VoxelRef& voxel) { return beliefs.strongest_class(voxel) == slot; });
}

Map cropped(const Map& map, const Region& region) {
  Map result(map.voxel_size_m, map.truncation_m);
  result.classes = map.classes;
  result.properties = map.properties;
  result.metadata = map.metadata;
  result.frames = map.frames;  // so that merging does not count them twice
  for (size_t b = 0; b < region.blocks(); ++b) {
    const Block* block = map.store.get(region.coord[b]);
    if (block == nullptr) continue;
    const BlockMask inside = region.mask[b] & observed_voxels(*block);
    if (inside.any())
      copy_observed(*block, inside, result.store, result.store[result.store.find_or_create(block->coord)]);
  }
  for (const Touch& touch : map.touches.touches) {
    Touch part = touch;
    part.region = intersected(touch.region, region);
    if (!part.region.empty()) result.touches.touches.push_back(std::move(part));
  }
  rebuild_touch_planes(result);
  return result;
}

Eigen::AlignedBox3d observed_bounds(const Map& map) {
  Eigen::AlignedBox3d bounds;
  for (const Block& block : map.store.blocks()) {
    // Most blocks lie inside what is already known.
    const bool known =
        bounds.contains(center_m(map, block.coord, 0)) && bounds.contains(center_m(map, block.coord, kBlockVoxels - 1));
    if (!known) for_each_bit(observed_voxels(block), [&](int i) { bounds.extend(center_m(map, block.coord, i)); });
  }
  return bounds;
}

}  // namespace felt
