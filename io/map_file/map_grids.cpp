#include "io/map_file/map_grids.h"

#include <openvdb/io/Compression.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <memory>
#include <utility>

#include "core/error.h"
#include "core/text.h"
#include "io/map_file/vdb_writer.h"
#include "mapping/grids/vdb_classes.h"
#include "mapping/grids/vdb_state.h"
#include "mapping/grids/vdb_touch.h"

namespace felt {
namespace {

bool chosen(const std::string& name, const std::vector<std::string>& asked) {
  return asked.empty() || std::any_of(asked.begin(), asked.end(), [&](const std::string& a) {
           return name == a || (a.ends_with('/') && name.starts_with(a));
         });
}

void require_known(const std::vector<LeafGrid>& all, const std::vector<std::string>& asked) {
  std::vector<std::string> problems;
  const std::string names = listed(all, &LeafGrid::name);
  for (const std::string& a : asked)
    if (std::none_of(all.begin(), all.end(), [&](const LeafGrid& grid) { return chosen(grid.name, {a}); }))
      problems.push_back(describe_mismatch("--grids", "grid of the map", "one of " + names, "'" + a + "'"));
  if (!problems.empty()) throw ConfigError(problems);
}

/// Whether floats of 16 bits hold what a grid shows: they end at 65,504, and below 2^-14 they have fewer digits the
/// smaller they are. Only a grid that is small throughout loses by that: elsewhere it is less than the rounding of its
/// greatest values. Whole numbers and masks are not touched.
bool fits_16_bits(const LeafGrid& grid) {
  const auto* leaves = std::get_if<Leaves<float>>(&grid.leaves);
  if (leaves == nullptr) return true;
  constexpr float kLeastNormal = 1.0f / (1 << 14);
  float greatest = std::abs(leaves->background);
  std::array<float, kBlockVoxels> values;
  for (size_t i = 0; i < leaves->coords->size(); ++i) {
    leaves->fill(i, values.data());
    for (const float value : values) greatest = std::max(greatest, std::abs(value));
  }
  return greatest == 0 || (greatest >= kLeastNormal && std::isfinite(openvdb::io::truncateRealToHalf(greatest)));
}

}  // namespace

std::vector<LeafGrid> state_grids(const Map& map) {
  const BlockLists lists = block_lists(map);
  std::vector<LeafGrid> grids = {tsdf_grid(map, lists.observed), weight_grid(map, lists.observed)};
  if (!lists.color.empty()) {
    grids.push_back(color_grid(map, lists.observed));
    grids.push_back(color_count_grid(map, lists.color));
  }
  for (int slot = 0; slot < map.classes.size(); ++slot)
    if (const BlockList& list = lists.evidence[size_t(slot)]; !list.empty())
      grids.push_back(evidence_grid(map, slot, list));
  if (!lists.even_evidence.empty()) grids.push_back(even_evidence_grid(map, lists.even_evidence));
  if (!lists.instance.empty()) {
    grids.push_back(instance_grid(map, lists.instance));
    grids.push_back(instance_votes_grid(map, lists.instance));
  }
  for (const Touch& touch : map.touches.touches)
    grids.push_back(region_grid(map, touch.region, touch_region_name(touch)));
  return grids;
}

std::vector<LeafGrid> view_grids(const Map& map) {
  if (map.classes.size() == 0) return {};
  const auto touched = std::make_shared<const std::vector<TouchView>>(touch_views(map));
  std::vector<LeafGrid> grids = {label_grid(map, touched), label_probability_grid(map, touched),
                                 entropy_grid(map, touched), total_evidence_grid(map)};
  std::vector<LeafGrid> touches = touch_grids(map, touched);
  std::move(touches.begin(), touches.end(), std::back_inserter(grids));
  return grids;
}

std::vector<LeafGrid> map_grids(const Map& map) {
  std::vector<LeafGrid> grids = state_grids(map), views = view_grids(map);
  std::move(views.begin(), views.end(), std::back_inserter(grids));
  return grids;
}

ExportedGrids export_vdb(const Map& map, const std::filesystem::path& path, const VdbExport& options) {
  openvdb::initialize();
  std::vector<LeafGrid> grids = map_grids(map);
  require_known(grids, options.grids);
  std::erase_if(grids, [&](const LeafGrid& grid) { return !chosen(grid.name, options.grids); });
  const std::string hash = map_hash(map);
  openvdb::MetaMap metadata;
  metadata.insertMeta("creator", openvdb::StringMetadata("feltmap export"));
  metadata.insertMeta("map_hash", openvdb::StringMetadata(hash));
  VdbWriter file(path);
  file.begin(metadata, grids.size(), hash);
  ExportedGrids written;
  for (const LeafGrid& whole : grids) {
    const LeafGrid grid = options.part != nullptr ? clipped(whole, *options.part) : whole;
    const bool in_16_bits = options.half && fits_16_bits(grid);
    file.write(grid, VdbCodec::zip, in_16_bits);
    written.names.push_back(grid.name);
    if (options.half && !in_16_bits) written.in_32_bits.push_back(grid.name);
  }
  file.commit();
  return written;
}

}  // namespace felt
