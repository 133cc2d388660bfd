#pragma once

#include <openvdb/openvdb.h>

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "mapping/map.h"
#include "mapping/store/region.h"

namespace felt {

/// Coordinates of the leaves of a grid, shared by grids that have the same.
using LeafCoords = std::shared_ptr<const std::vector<BlockCoord>>;

/// The stock grid of a type of values.
template <typename Value>
struct StockGrid;
template <>
struct StockGrid<float> {
  using type = openvdb::FloatGrid;
};
template <>
struct StockGrid<int32_t> {
  using type = openvdb::Int32Grid;
};
template <>
struct StockGrid<openvdb::Vec3s> {
  using type = openvdb::Vec3SGrid;
};

/// Leaves of a grid of one type of value, each made when it is asked for.
template <typename Value>
struct Leaves {
  Value background{};
  LeafCoords coords;  ///< each once
  /// Writes the 512 values of the leaf at (*coords)[i], inactive ones too, and returns which are active. The same each
  /// time; several threads may ask at once.
  std::function<BlockMask(size_t i, Value* values)> fill;
  bool keeps_empty = false;  ///< a leaf without an active value is one as well
};

/// A stock OpenVDB grid of a map described leaf by leaf: a file is written from that without building a tree. The map
/// that it was made of must outlive it and stay as it is.
struct LeafGrid {
  std::string name;
  double voxel_size_m = 1;
  /// A region: a mask grid.
  std::variant<Leaves<float>, Leaves<int32_t>, Leaves<openvdb::Vec3s>, Region> leaves;
  openvdb::GridClass grid_class = openvdb::GRID_UNKNOWN;
  bool noisy = false;  ///< values that compression hardly shortens: distances, weights, colours
};

/// Whether leaf `a` stands before leaf `b` in a tree of stock grids (5-4-3), and so in a file.
bool before_in_tree(const BlockCoord& a, const BlockCoord& b);

/// A grid without leaves: type, background, name, transform and class.
openvdb::GridBase::Ptr stock_grid_without_leaves(const LeafGrid& grid);
/// The grid as a tree.
openvdb::GridBase::Ptr stock_grid(const LeafGrid& grid);

/// The grid with nothing but what lies in `region`: other voxels are inactive and hold the background. `region` must
/// outlive the result.
LeafGrid clipped(const LeafGrid& grid, const Region& region);

}  // namespace felt
