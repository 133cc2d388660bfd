#include "mapping/vdb_views.h"

#include <algorithm>

#include "mapping/leaf_mask.h"

namespace felt {
namespace {

openvdb::Coord first_coord(const BlockCoord& c) { return {c.x * 8, c.y * 8, c.z * 8}; }

/// One leaf per observed block, active where weight > 0; `write` fills the 512 values.
template <typename Grid, typename Write>
typename Grid::Ptr make_grid(const Map& map, const char* name, typename Grid::ValueType background, Write write) {
  openvdb::initialize();
  auto grid = Grid::create(background);
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(map.voxel_size_m));
  using Leaf = typename Grid::TreeType::LeafNodeType;
  openvdb::tree::ValueAccessor<typename Grid::TreeType> accessor(grid->tree());
  for (const Block& block : map.store.blocks()) {
    if (!block.geometry->observed()) continue;
    auto leaf = std::make_unique<Leaf>(openvdb::PartialCreate(), first_coord(block.coord));
    write(block, leaf->buffer().data());
    set_active(*leaf, [&](int i) { return block.geometry->weight[i] > 0; });
    accessor.addLeaf(leaf.release());
  }
  return grid;
}

}  // namespace

openvdb::FloatGrid::Ptr tsdf_grid(const Map& map) {
  auto grid = make_grid<openvdb::FloatGrid>(map, "tsdf", float(map.truncation_m), [](const Block& b, float* out) {
    std::copy_n(b.geometry->tsdf, kBlockVoxels, out);
  });
  grid->setGridClass(openvdb::GRID_LEVEL_SET);
  return grid;
}

openvdb::FloatGrid::Ptr weight_grid(const Map& map) {
  return make_grid<openvdb::FloatGrid>(
      map, "weight", 0.0f, [](const Block& b, float* out) { std::copy_n(b.geometry->weight, kBlockVoxels, out); });
}

openvdb::Vec3SGrid::Ptr color_grid(const Map& map) {
  auto grid =
      make_grid<openvdb::Vec3SGrid>(map, "color", openvdb::Vec3s(0.0f), [](const Block& b, openvdb::Vec3s* out) {
        if (b.color == nullptr) {
          std::fill_n(out, kBlockVoxels, openvdb::Vec3s(0.0f));
          return;
        }
        constexpr float kScale = 1.0f / (255 * 256);
        for (int i = 0; i < kBlockVoxels; ++i)
          out[i] = openvdb::Vec3s(b.color->r[i] * kScale, b.color->g[i] * kScale, b.color->b[i] * kScale);
      });
  grid->setVectorType(openvdb::VEC_INVARIANT);
  return grid;
}

}  // namespace felt
