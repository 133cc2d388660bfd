#include "io/map_file/map_views.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <set>
#include <string>
#include <type_traits>
#include <utility>

#include "io/map_file/map_grids.h"

namespace felt {
namespace {

/// The voxels of one grid that are not as they should be.
class Strays {
public:
  void add(const BlockCoord& block, const BlockMask& voxels) {
    for_each_bit(voxels, [&](int i) {
      if (count_ == 0 || block < block_) block_ = block, offset_ = i;
      ++count_;
    });
  }
  void add(const Region& region) {
    for (size_t b = 0; b < region.blocks(); ++b) add(region.coord[b], region.mask[b]);
  }
  bool other_background = false;
  size_t count() const { return count_; }
  MapFault fault(const std::string& grid) const {
    const Index3 base = first_voxel(block_), in = voxel_of_offset(offset_);
    return {grid, "what the view shows follows from the map", count_, {base.x + in.x, base.y + in.y, base.z + in.z}};
  }

private:
  size_t count_ = 0;
  BlockCoord block_{};
  int offset_ = 0;
};

/// `greatest`: the greatest magnitude near by, beside which values near zero are the rest of a difference.
template <typename Value>
bool same(const Value& a, const Value& b, float greatest) {
  if (a == b) return true;
  if constexpr (std::is_same_v<Value, float>)
    return std::abs(a - b) <= 1e-3f * std::max(std::abs(a), std::abs(b)) + 1e-5f * greatest;
  return false;
}

template <typename Value>
float greatest_magnitude(const std::array<Value, kBlockVoxels>& values) {
  float greatest = 0;
  if constexpr (std::is_same_v<Value, float>)
    for (const float value : values) greatest = std::max(greatest, std::abs(value));
  return greatest;
}

template <typename Value>
void compare(const VdbReader& file, const std::string& name, const Leaves<Value>& leaves, Strays& strays) {
  const std::vector<BlockCoord>& coords = *leaves.coords;
  std::vector<size_t> order(coords.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](size_t a, size_t b) { return before_in_tree(coords[a], coords[b]); });
  std::array<Value, kBlockVoxels> expected;
  size_t next = 0;
  const auto next_is_before = [&](const BlockCoord& coord) {
    return next < order.size() && before_in_tree(coords[order[next]], coord);
  };
  const auto fill_next = [&] { return leaves.fill(order[next++], expected.data()); };
  const auto add_missing = [&] {
    const BlockCoord coord = coords[order[next]];
    strays.add(coord, fill_next());
  };
  const Value background = file.read<Value>(name, [&](const VdbLeaf<Value>& leaf) {
    while (next_is_before(leaf.coord)) add_missing();
    BlockMask active;
    expected.fill(leaves.background);
    if (next < order.size() && coords[order[next]] == leaf.coord) active = fill_next();
    BlockMask strange = (leaf.active - active) | (active - leaf.active);
    const float greatest = greatest_magnitude(expected);
    for (int i = 0; i < kBlockVoxels; ++i)
      if (!same(leaf.values[i], expected[size_t(i)], greatest)) strange.set(i);
    strays.add(leaf.coord, strange);
  });
  while (next < order.size()) add_missing();
  strays.other_background = !same(background, leaves.background, 0);
}

void compare(const VdbReader& file, const std::string& name, const Region& region, Strays& strays) {
  const Region found = file.read_mask(name);
  strays.add(subtracted(found, region));
  strays.add(subtracted(region, found));
}

/// Beginnings of the names of grids that belong to a class, a touch or a property of the map.
constexpr const char* kFamilies[] = {"evidence/", "touch_region/", "touch/", "property/"};

}  // namespace

std::vector<MapFault> view_faults(const VdbReader& file, const Map& map, size_t& compared) {
  std::vector<MapFault> faults;
  std::set<std::string> known;
  for (const LeafGrid& grid : state_grids(map)) known.insert(grid.name);
  compared = 0;
  for (const LeafGrid& grid : view_grids(map)) {
    known.insert(grid.name);
    if (!file.has(grid.name)) continue;
    ++compared;
    Strays strays;
    std::visit([&](const auto& leaves) { compare(file, grid.name, leaves, strays); }, grid.leaves);
    if (strays.count() > 0) faults.push_back(strays.fault(grid.name));
    if (strays.other_background) faults.push_back({grid.name, "the background follows from the map", 0, {}});
  }
  for (const VdbGridEntry& entry : file.grids())
    if (std::any_of(std::begin(kFamilies), std::end(kFamilies),
                    [&](const char* family) { return entry.name.starts_with(family); }) &&
        !known.contains(entry.name))
      faults.push_back({entry.name, "every grid belongs to a class, a touch or a property of the map", 0, {}});
  return faults;
}

}  // namespace felt
