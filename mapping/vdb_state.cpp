#include "mapping/vdb_state.h"

#include <algorithm>

#include "core/error.h"
#include "mapping/leaf_mask.h"

namespace felt {
namespace {

openvdb::Coord first_coord(const BlockCoord& c) { return {c.x * 8, c.y * 8, c.z * 8}; }
BlockCoord block_at(const openvdb::Coord& origin) { return block_of_voxel({origin.x(), origin.y(), origin.z()}); }

/// Grid without background surprises: a leaf for each block where `values(block, out)` says there is a plane, active
/// where the value is not zero.
template <typename Grid, typename Values>
typename Grid::Ptr state_grid(const Map& map, const std::string& name, Values values) {
  openvdb::initialize();
  auto grid = Grid::create(typename Grid::ValueType(0));
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel_size_m));
  using Leaf = typename Grid::TreeType::LeafNodeType;
  std::unique_ptr<Leaf> leaf;
  for (const uint32_t number : map.store.sorted()) {
    const Block& block = map.store[number];
    if (!block.geometry->observed()) continue;
    if (leaf == nullptr) leaf = std::make_unique<Leaf>();
    leaf->setOrigin(first_coord(block.coord));
    typename Grid::ValueType* out = leaf->buffer().data();
    if (!values(block, out)) continue;
    set_active(*leaf, [out](int i) { return out[i] != 0; });
    grid->tree().addLeaf(leaf.release());
  }
  return grid;
}

[[noreturn]] void fail(const openvdb::GridBase& grid, const std::string& what, const std::string& expected,
                       const std::string& found) {
  throw FormatError(describe_mismatch("grid '" + grid.getName() + "'", what, expected, found));
}

std::string text(const openvdb::Coord& c) {
  return "(" + std::to_string(c.x()) + ", " + std::to_string(c.y()) + ", " + std::to_string(c.z()) + ")";
}

template <typename Grid>
void require_leaves_only(const Grid& grid) {
  if (grid.tree().root().onTileCount() != 0 || grid.tree().activeTileCount() != 0)
    fail(grid, "values", "leaves only", "active tiles");
}

template <typename Grid>
Block& block_of_leaf(Map& map, const Grid& grid, const openvdb::Coord& origin) {
  const uint32_t number = map.store.find(block_at(origin));
  if (number == BlockStore::kNone) fail(grid, "leaf at " + text(origin), "a leaf of 'tsdf' there", "none");
  return map.store[number];
}

/// The exact inverse of color_grid's scale: a 16-bit value survives the trip through float.
uint16_t stored_color(float value) {
  return value > 0 ? uint16_t(int32_t(std::min(value * (255.0f * 256), 65535.0f) + 0.5f)) : uint16_t(0);
}

}  // namespace

openvdb::Int32Grid::Ptr color_count_grid(const Map& map) {
  return state_grid<openvdb::Int32Grid>(map, "color_count", [](const Block& block, int32_t* out) {
    if (block.color == nullptr) return false;
    std::copy_n(block.color->count, kBlockVoxels, out);
    return true;
  });
}

std::string evidence_name(const Map& map, int slot) { return "evidence/" + map.classes.at_slot(slot).name; }

openvdb::FloatGrid::Ptr evidence_grid(const Map& map, int slot) {
  auto grid = state_grid<openvdb::FloatGrid>(map, evidence_name(map, slot), [slot](const Block& block, float* out) {
    for (const EvidencePlane& plane : block.evidence)
      if (plane.slot == slot) {
        std::copy_n(plane.counts->value, kBlockVoxels, out);
        return true;
      }
    return false;
  });
  return grid->tree().leafCount() == 0 ? nullptr : grid;
}

void add_geometry(Map& map, const openvdb::FloatGrid& tsdf, const openvdb::FloatGrid& weight) {
  require_leaves_only(tsdf);
  require_leaves_only(weight);
  if (tsdf.tree().leafCount() != weight.tree().leafCount())
    fail(weight, "leaves", std::to_string(tsdf.tree().leafCount()) + " as in 'tsdf'",
         std::to_string(weight.tree().leafCount()));
  auto weights = weight.tree().cbeginLeaf();
  for (auto leaf = tsdf.tree().cbeginLeaf(); leaf; ++leaf, ++weights) {
    if (leaf->origin() != weights->origin()) fail(weight, "leaf", text(leaf->origin()), text(weights->origin()));
    Block& block = map.store[map.store.find_or_create(block_at(leaf->origin()))];
    std::copy_n(leaf->buffer().data(), kBlockVoxels, block.geometry->tsdf);
    std::copy_n(weights->buffer().data(), kBlockVoxels, block.geometry->weight);
  }
}

void add_color(Map& map, const openvdb::Vec3SGrid& color, const openvdb::Int32Grid& count) {
  require_leaves_only(color);
  require_leaves_only(count);
  for (auto leaf = count.tree().cbeginLeaf(); leaf; ++leaf) {
    Block& block = block_of_leaf(map, count, leaf->origin());
    const auto* colors = color.tree().probeConstLeaf(leaf->origin());
    if (colors == nullptr) fail(color, "leaf", text(leaf->origin()), "none");
    ColorPlanes& planes = map.store.add_color(block);
    for (int i = 0; i < kBlockVoxels; ++i) {
      const openvdb::Vec3s& rgb = colors->buffer().data()[i];
      planes.r[i] = stored_color(rgb.x());
      planes.g[i] = stored_color(rgb.y());
      planes.b[i] = stored_color(rgb.z());
      const int32_t n = leaf->buffer().data()[i];
      if (n < 0 || n > 0xffff) fail(count, "observations", "0 to 65535", std::to_string(n));
      planes.count[i] = uint16_t(n);
    }
  }
}

void add_evidence(Map& map, int slot, const openvdb::FloatGrid& evidence) {
  require_leaves_only(evidence);
  for (auto leaf = evidence.tree().cbeginLeaf(); leaf; ++leaf) {
    Block& block = block_of_leaf(map, evidence, leaf->origin());
    Plane* plane = map.store.new_plane();
    std::copy_n(leaf->buffer().data(), kBlockVoxels, plane->value);
    block.evidence.push_back({uint16_t(slot), plane});
  }
}

}  // namespace felt
