#include "mapping/grids/vdb_state.h"

#include <algorithm>
#include <utility>

#include "mapping/grids/leaf_mask.h"
#include "mapping/labels/class_belief.h"

namespace felt {
namespace {

/// A leaf for each block of the list; `write(block, values)` fills it and returns what is active.
template <typename Value, typename Write>
LeafGrid state_grid(const Map& map, std::string name, Value background, const BlockList& list, Write write) {
  Leaves<Value> leaves;
  leaves.background = background;
  leaves.coords = list.coords;
  leaves.keeps_empty = true;
  leaves.fill = [&map, blocks = list.blocks, write](size_t i, Value* values) {
    return write(map.store[(*blocks)[i]], values);
  };
  return {.name = std::move(name), .voxel_size_m = map.voxel_size_m, .leaves = std::move(leaves)};
}

/// Active where weight > 0.
template <typename Value, typename Write>
LeafGrid surface_grid(const Map& map, std::string name, Value background, const BlockList& list, Write write) {
  LeafGrid grid = state_grid<Value>(map, std::move(name), background, list, [write](const Block& block, Value* values) {
    write(block, values);
    return observed_voxels(block);
  });
  grid.noisy = true;
  return grid;
}

/// Active where not 0. `plane(block)`: 512 numbers.
template <typename Value, typename PlaneOf>
LeafGrid plane_grid(const Map& map, std::string name, const BlockList& list, PlaneOf plane) {
  return state_grid<Value>(map, std::move(name), Value(0), list, [plane](const Block& block, Value* values) {
    std::copy_n(plane(block), kBlockVoxels, values);
    return mask_where([values](int i) { return values[i] != 0; });
  });
}

}  // namespace

BlockList block_list(const Map& map, std::vector<uint32_t> blocks) {
  const auto before = [&](uint32_t a, uint32_t b) { return before_in_tree(map.store[a].coord, map.store[b].coord); };
  if (!std::is_sorted(blocks.begin(), blocks.end(), before)) std::sort(blocks.begin(), blocks.end(), before);
  std::vector<BlockCoord> coords;
  coords.reserve(blocks.size());
  for (const uint32_t number : blocks) coords.push_back(map.store[number].coord);
  return {std::make_shared<const std::vector<uint32_t>>(std::move(blocks)),
          std::make_shared<const std::vector<BlockCoord>>(std::move(coords))};
}

BlockLists block_lists(const Map& map) {
  std::vector<uint32_t> blocks;
  for (uint32_t number = 0; number < map.store.size(); ++number)
    if (map.store[number].geometry->observed()) blocks.push_back(number);
  BlockLists lists;
  lists.observed = block_list(map, std::move(blocks));
  std::vector<uint32_t> color, even_evidence, instance;
  std::vector<std::vector<uint32_t>> evidence(size_t(map.classes.size()));
  for (const uint32_t number : *lists.observed.blocks) {
    const Block& block = map.store[number];
    if (block.color != nullptr) color.push_back(number);
    if (block.even_evidence != nullptr) even_evidence.push_back(number);
    if (block.instance != nullptr) instance.push_back(number);
    for (const EvidencePlane& plane : block.evidence) evidence.at(plane.slot).push_back(number);
  }
  lists.color = block_list(map, std::move(color));
  lists.even_evidence = block_list(map, std::move(even_evidence));
  lists.instance = block_list(map, std::move(instance));
  for (std::vector<uint32_t>& numbers : evidence) lists.evidence.push_back(block_list(map, std::move(numbers)));
  return lists;
}

LeafGrid tsdf_grid(const Map& map, const BlockList& observed) {
  LeafGrid grid = surface_grid(map, "tsdf", float(map.truncation_m), observed, [](const Block& block, float* values) {
    std::copy_n(block.geometry->tsdf, kBlockVoxels, values);
  });
  grid.grid_class = openvdb::GRID_LEVEL_SET;
  return grid;
}

LeafGrid weight_grid(const Map& map, const BlockList& observed) {
  return surface_grid(map, "weight", 0.0f, observed, [](const Block& block, float* values) {
    std::copy_n(block.geometry->weight, kBlockVoxels, values);
  });
}

LeafGrid color_grid(const Map& map, const BlockList& observed) {
  return surface_grid(map, "color", openvdb::Vec3s(0.0f), observed, [](const Block& block, openvdb::Vec3s* values) {
    if (block.color == nullptr) {
      std::fill_n(values, kBlockVoxels, openvdb::Vec3s(0.0f));
      return;
    }
    constexpr float kScale = 1.0f / (255 * 256);
    const ColorPlanes& color = *block.color;
    for (int i = 0; i < kBlockVoxels; ++i)
      values[i] = openvdb::Vec3s(color.r[i] * kScale, color.g[i] * kScale, color.b[i] * kScale);
  });
}

LeafGrid color_count_grid(const Map& map, const BlockList& list) {
  return plane_grid<int32_t>(map, "color_count", list, [](const Block& block) { return block.color->count; });
}

std::string evidence_name(const Map& map, int slot) { return "evidence/" + map.classes.at_slot(slot).name; }

LeafGrid evidence_grid(const Map& map, int slot, const BlockList& list) {
  return plane_grid<float>(map, evidence_name(map, slot), list,
                           [slot](const Block& block) { return evidence_counts(block, slot)->value; });
}

LeafGrid even_evidence_grid(const Map& map, const BlockList& list) {
  return plane_grid<float>(map, "evidence_even", list, [](const Block& block) { return block.even_evidence->value; });
}

LeafGrid instance_grid(const Map& map, const BlockList& list) {
  return plane_grid<int32_t>(map, "instance", list, [](const Block& block) { return block.instance->id; });
}

LeafGrid instance_votes_grid(const Map& map, const BlockList& list) {
  return plane_grid<int32_t>(map, "instance_votes", list, [](const Block& block) { return block.instance->votes; });
}

}  // namespace felt
