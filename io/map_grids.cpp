#include "io/map_grids.h"

#include <algorithm>
#include <iterator>
#include <memory>
#include <utility>

#include "core/error.h"
#include "io/vdb_file.h"
#include "mapping/vdb_classes.h"
#include "mapping/vdb_state.h"
#include "mapping/vdb_touch.h"
#include "mapping/vdb_views.h"

namespace felt {
namespace {

bool chosen(const std::string& name, const std::vector<std::string>& asked) {
  return asked.empty() || std::any_of(asked.begin(), asked.end(), [&](const std::string& a) {
           return name == a || (a.ends_with('/') && name.starts_with(a));
         });
}

void require_known(const std::vector<MapGrid>& all, const std::vector<std::string>& asked) {
  std::vector<std::string> problems;
  std::string names;
  for (const MapGrid& grid : all) names += (names.empty() ? "" : ", ") + grid.name;
  for (const std::string& a : asked)
    if (std::none_of(all.begin(), all.end(), [&](const MapGrid& grid) { return chosen(grid.name, {a}); }))
      problems.push_back(describe_mismatch("--grids", "grid of the map", "one of " + names, "'" + a + "'"));
  if (!problems.empty()) throw ConfigError(problems);
}

/// Switches off what lies outside the region, and drops leaves that hold nothing then.
template <typename Grid>
void clip(Grid& grid, const Region& region) {
  using Leaf = typename Grid::TreeType::LeafNodeType;
  std::vector<openvdb::Coord> outside;
  for (auto leaf = grid.tree().beginLeaf(); leaf; ++leaf) {
    const openvdb::Coord o = leaf->origin();
    const BlockMask* inside = region.find(block_of_voxel({o.x(), o.y(), o.z()}));
    for (openvdb::Index i = 0; i < Leaf::SIZE; ++i)
      if (inside == nullptr || !inside->test(int(i))) leaf->setValueOff(i, grid.background());
    if (leaf->getValueMask().isOff()) outside.push_back(o);
  }
  for (const openvdb::Coord& o : outside) delete grid.tree().template stealNode<Leaf>(o, grid.background(), false);
}

openvdb::GridBase::Ptr clipped(const Map& map, const openvdb::GridBase::Ptr& grid, const Region& region) {
  if (const auto mask = openvdb::gridPtrCast<openvdb::MaskGrid>(grid))
    return region_grid(map, intersected(region_of(*mask), region), grid->getName());
  if (const auto values = openvdb::gridPtrCast<openvdb::FloatGrid>(grid)) clip(*values, region);
  if (const auto values = openvdb::gridPtrCast<openvdb::Vec3SGrid>(grid)) clip(*values, region);
  if (const auto values = openvdb::gridPtrCast<openvdb::Int32Grid>(grid)) clip(*values, region);
  return grid;
}

}  // namespace

std::vector<MapGrid> state_grids(const Map& map) {
  std::vector<MapGrid> grids;
  grids.push_back({"tsdf", [&] { return tsdf_grid(map); }, true});
  grids.push_back({"weight", [&] { return weight_grid(map); }, true});
  const auto lists = std::make_shared<const BlockLists>(block_lists(map));
  if (!lists->color.empty()) {
    grids.push_back({"color", [&] { return color_grid(map); }, true});
    grids.push_back({"color_count", [&map, lists] { return color_count_grid(map, lists->color); }});
  }
  for (int slot = 0; slot < map.classes.size(); ++slot)
    if (const auto& blocks = lists->evidence[size_t(slot)]; !blocks.empty())
      grids.push_back(
          {evidence_name(map, slot), [&map, lists, slot, &blocks] { return evidence_grid(map, slot, blocks); }});
  const auto any = [&](auto has) { return std::any_of(map.store.blocks().begin(), map.store.blocks().end(), has); };
  if (any([](const Block& b) { return b.even_evidence != nullptr && b.geometry->observed(); }))
    grids.push_back({"evidence_even", [&] { return even_evidence_grid(map); }});
  if (any([](const Block& b) { return b.instance != nullptr && b.geometry->observed(); })) {
    grids.push_back({"instance", [&] { return instance_grid(map); }});
    grids.push_back({"instance_votes", [&] { return instance_votes_grid(map); }});
  }
  for (const Touch& touch : map.touches.touches)
    grids.push_back({touch_region_name(touch),
                     [&map, &touch] { return region_grid(map, touch.region, touch_region_name(touch)); }});
  return grids;
}

std::vector<MapGrid> view_grids(const Map& map) {
  std::vector<MapGrid> grids;
  if (map.classes.size() == 0) return grids;
  const auto touched = std::make_shared<const std::vector<TouchView>>(touch_views(map));
  grids.push_back({"label", [&map, touched] { return label_grid(map, *touched); }});
  grids.push_back({"label_prob", [&map, touched] { return label_probability_grid(map, *touched); }});
  grids.push_back({"entropy", [&map, touched] { return entropy_grid(map, *touched); }});
  grids.push_back({"evidence_total", [&map] { return total_evidence_grid(map); }});
  for (NamedGrid& grid : touch_grids(map, touched)) grids.push_back({std::move(grid.name), std::move(grid.make)});
  return grids;
}

std::vector<MapGrid> map_grids(const Map& map) {
  std::vector<MapGrid> grids = state_grids(map), views = view_grids(map);
  std::move(views.begin(), views.end(), std::back_inserter(grids));
  return grids;
}

std::vector<std::string> export_vdb(const Map& map, const std::filesystem::path& path, const VdbExport& options) {
  openvdb::initialize();
  std::vector<MapGrid> grids = map_grids(map);
  require_known(grids, options.grids);
  std::erase_if(grids, [&](const MapGrid& grid) { return !chosen(grid.name, options.grids); });
  openvdb::MetaMap metadata;
  metadata.insertMeta("creator", openvdb::StringMetadata("feltmap export"));
  metadata.insertMeta("map_hash", openvdb::StringMetadata(map_hash(map)));
  VdbFile file(path);
  file.begin(metadata, grids.size(), map_hash(map));
  std::vector<std::string> names;
  for (const MapGrid& grid : grids) {
    openvdb::GridBase::Ptr made = grid.make();
    if (options.part != nullptr) made = clipped(map, made, *options.part);
    made->setSaveFloatAsHalf(options.half);
    file.write(*made, MapCompression::zip, grid.noisy);
    names.push_back(grid.name);
  }
  file.commit("");
  return names;
}

}  // namespace felt
