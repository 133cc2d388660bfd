#include "io/map_file/map_file.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <functional>
#include <sstream>
#include <utility>
#include <vector>

#include "core/error.h"
#include "io/files/opened_file.h"
#include "io/map_file/map_grids.h"
#include "io/map_file/map_metadata.h"
#include "io/map_file/map_trailer.h"
#include "io/map_file/map_views.h"
#include "io/map_file/vdb_reader.h"
#include "io/map_file/vdb_writer.h"
#include "mapping/grids/leaf_mask.h"
#include "mapping/grids/vdb_state.h"
#include "mapping/grids/vdb_touch.h"
#include "mapping/touch/touch_update.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void fail_leaf(const std::string& where, const std::string& grid, const BlockCoord& coord,
                            const std::string& expected, const std::string& found) {
  const Index3 first = first_voxel(coord);
  throw FormatError(describe_mismatch(
      where + ": grid '" + grid + "'",
      "leaf at (" + std::to_string(first.x) + ", " + std::to_string(first.y) + ", " + std::to_string(first.z) + ")",
      expected, found));
}

Block& block_of_leaf(Map& map, const BlockCoord& coord, const std::string& grid, const std::string& where) {
  const uint32_t number = map.store.find(coord);
  if (number == BlockStore::kNone) fail_leaf(where, grid, coord, "a leaf of 'tsdf' there", "none");
  return map.store[number];
}

uint16_t u16_of(int32_t value, const std::string& where, const std::string& grid, const BlockCoord& coord) {
  if (value < 0 || value > 0xffff) fail_leaf(where, grid, coord, "0 to 65535", std::to_string(value));
  return uint16_t(value);
}

void require_leaves(size_t found, size_t expected, const std::string& grid, const std::string& where) {
  if (found != expected)
    throw FormatError(describe_mismatch(where + ": grid '" + grid + "'", "leaves",
                                        std::to_string(expected) + ", one for each that belongs to it",
                                        std::to_string(found)));
}

/// What is loaded does not depend on which voxels are active, but what other programs see does.
void require_active(const BlockMask& found, const BlockMask& expected, const char* rule, const BlockCoord& coord,
                    const std::string& grid, const std::string& where) {
  if (!(found == expected))
    fail_leaf(where, grid, coord, "voxels active where " + std::string(rule),
              std::to_string((found - expected).count() + (expected - found).count()) + " that are not so");
}

/// Reads a grid, and throws unless it holds the background beside its leaves: what other programs see there.
template <typename Value>
void read_grid(const VdbReader& file, const std::string& grid, const Value& background, const std::string& where,
               const std::function<void(const VdbLeaf<Value>&)>& visit) {
  if (const Value found = file.read<Value>(grid, visit); !(found == background)) {
    std::ostringstream expected, other;
    expected << background, other << found;
    throw FormatError(describe_mismatch(where + ": grid '" + grid + "'", "background", expected.str(), other.str()));
  }
}

/// Calls `visit(block, values)` for each leaf of a grid that is active where a value is not 0.
template <typename Value, typename Visit>
void load_plane(const VdbReader& file, const std::string& grid, const std::string& where, Map& map, Visit visit) {
  read_grid<Value>(file, grid, Value(0), where, [&](const VdbLeaf<Value>& leaf) {
    visit(block_of_leaf(map, leaf.coord, grid, where), leaf.values);
    require_active(leaf.active, mask_where([values = leaf.values](int i) { return values[i] != 0; }),
                   "the value is not 0", leaf.coord, grid, where);
  });
}

constexpr const char* kWhereObserved = "weight > 0";

/// Returns which voxels were observed, by number of block.
std::vector<BlockMask> load_geometry(const VdbReader& file, const std::string& where, Map& map) {
  std::vector<BlockMask> observed;
  read_grid<float>(file, "tsdf", float(map.truncation_m), where, [&](const VdbLeaf<float>& leaf) {
    std::copy_n(leaf.values, kBlockVoxels, map.store[map.store.find_or_create(leaf.coord)].geometry->tsdf);
    observed.push_back(leaf.active);
  });
  size_t leaves = 0;
  read_grid<float>(file, "weight", 0.0f, where, [&](const VdbLeaf<float>& leaf) {
    std::copy_n(leaf.values, kBlockVoxels, block_of_leaf(map, leaf.coord, "weight", where).geometry->weight);
    const BlockMask expected = mask_where([values = leaf.values](int i) { return values[i] > 0; });
    require_active(leaf.active, expected, kWhereObserved, leaf.coord, "weight", where);
    require_active(observed[map.store.find(leaf.coord)], expected, kWhereObserved, leaf.coord, "tsdf", where);
    ++leaves;
  });
  require_leaves(leaves, map.store.size(), "weight", where);
  return observed;
}

void load_color(const VdbReader& file, const std::vector<BlockMask>& observed, const std::string& where, Map& map) {
  load_plane<int32_t>(file, "color_count", where, map, [&](Block& block, const int32_t* counts) {
    ColorPlanes& planes = map.store.add_color(block);
    for (int i = 0; i < kBlockVoxels; ++i) planes.count[i] = u16_of(counts[i], where, "color_count", block.coord);
  });
  size_t leaves = 0;
  read_grid<openvdb::Vec3s>(file, "color", openvdb::Vec3s(0.0f), where, [&](const VdbLeaf<openvdb::Vec3s>& leaf) {
    // Blocks without colour have a leaf here too: the grid's topology is that of `tsdf`.
    const uint32_t number = map.store.find(leaf.coord);
    ColorPlanes* planes = block_of_leaf(map, leaf.coord, "color", where).color;
    require_active(leaf.active, observed[number], kWhereObserved, leaf.coord, "color", where);
    ++leaves;
    // The exact inverse of color_grid's scale: a 16-bit value survives the trip through float.
    constexpr float kScale = 255 * 256;
    const float* values = leaf.values[0].asPointer();
    const float most = planes != nullptr ? 65535.25f / kScale : 0.0f;  // what rounds to 16 bits
    int outside = 0;
    for (int i = 0; i < 3 * kBlockVoxels; ++i) outside += values[i] >= 0 && values[i] <= most ? 0 : 1;
    if (outside > 0)
      fail_leaf(where, "color", leaf.coord, planes != nullptr ? "numbers of 0 to 1" : "0, as 'color_count' has no leaf",
                std::to_string(outside) + " others");
    if (planes == nullptr) return;
    for (int i = 0; i < kBlockVoxels; ++i) {
      const openvdb::Vec3s& rgb = leaf.values[i];
      planes->r[i] = uint16_t(int32_t(rgb.x() * kScale + 0.5f));
      planes->g[i] = uint16_t(int32_t(rgb.y() * kScale + 0.5f));
      planes->b[i] = uint16_t(int32_t(rgb.z() * kScale + 0.5f));
    }
  });
  require_leaves(leaves, map.store.size(), "color", where);
}

/// Classes in ascending order of slot.
void load_evidence(const VdbReader& file, const std::string& where, Map& map) {
  for (int slot = 0; slot < map.classes.size(); ++slot) {
    const std::string name = evidence_name(map, slot);
    if (!file.has(name)) continue;
    load_plane<float>(file, name, where, map, [&](Block& block, const float* counts) {
      Plane* plane = map.store.new_plane();
      std::copy_n(counts, kBlockVoxels, plane->value);
      block.evidence.push_back({uint16_t(slot), plane});
    });
  }
}

void load_even_evidence(const VdbReader& file, const std::string& where, Map& map) {
  load_plane<float>(file, "evidence_even", where, map, [&](Block& block, const float* counts) {
    block.even_evidence = map.store.new_plane();
    std::copy_n(counts, kBlockVoxels, block.even_evidence->value);
  });
}

void load_instances(const VdbReader& file, const std::string& where, Map& map) {
  size_t instances = 0, leaves = 0;
  const auto load = [&](const char* name, uint16_t(InstancePlanes::*plane)[kBlockVoxels], size_t& count) {
    load_plane<int32_t>(file, name, where, map, [&](Block& block, const int32_t* values) {
      if (&count == &leaves && block.instance == nullptr)
        fail_leaf(where, name, block.coord, "a leaf of 'instance' there", "none");
      InstancePlanes& planes = map.store.add_instance(block);
      for (int i = 0; i < kBlockVoxels; ++i) (planes.*plane)[i] = u16_of(values[i], where, name, block.coord);
      ++count;
    });
  };
  load("instance", &InstancePlanes::id, instances);
  load("instance_votes", &InstancePlanes::votes, leaves);
  require_leaves(leaves, instances, "instance_votes", where);
}

VdbCodec codec_of(MapCompression compression, bool noisy) {
  if (compression == MapCompression::fast) return noisy ? VdbCodec::none : VdbCodec::blosc;
  return compression == MapCompression::blosc ? VdbCodec::blosc
         : compression == MapCompression::zip ? VdbCodec::zip
                                              : VdbCodec::none;
}

Map read_map(const VdbReader& file, const std::string& where) {
  MapHeader header = read_metadata(file.metadata(), where);
  Map map(header.voxel_size_m, header.truncation_m);
  map.classes = std::move(header.classes);
  map.frames = std::move(header.frames);
  map.metadata = std::move(header.metadata);
  file.require_voxel_size(map.voxel_size_m);
  const std::vector<BlockMask> observed = load_geometry(file, where, map);
  if (file.has("color_count") || file.has("color")) load_color(file, observed, where, map);
  load_evidence(file, where, map);
  if (file.has("evidence_even")) load_even_evidence(file, where, map);
  if (file.has("instance")) load_instances(file, where, map);
  map.properties = std::move(header.properties);
  map.touches = std::move(header.touches);
  for (Touch& touch : map.touches.touches) {
    if (!map.properties.index_of(touch.request.property))
      throw FormatError(describe_mismatch(where, "touch " + id_text(touch.id), "a property of the map's table",
                                          "'" + touch.request.property + "'"));
    touch.region = file.read_mask(touch_region_name(touch));
  }
  rebuild_touch_planes(map);
  if (const std::string hash = map_hash(map); hash != header.hash)
    throw FormatError(describe_mismatch(where, "map hash", header.hash, hash));
  return map;
}

}  // namespace

std::string save_map(const Map& map, const fs::path& path, const SaveOptions& options) {
  MapTrailer trailer;
  VdbWriter file(path, &trailer);
  const std::vector<LeafGrid> grids = options.views ? map_grids(map) : state_grids(map);
  std::string hash = map_hash(map);
  file.begin(to_metadata(map, hash), grids.size(), hash);
  for (const LeafGrid& grid : grids) file.write(grid, codec_of(options.compression, grid.noisy));
  file.commit(trailer.finish(kMapFileVersion));
  return hash;
}

Map load_map(const fs::path& path) {
  // Opened once: another program may replace the file meanwhile.
  const std::string where = path.string();
  const OpenedFile opened(path);
  return read_map(VdbReader(opened, verify_map_trailer(opened, where, kMapFileVersion), where), where);
}

ExaminedMap examine_map(const fs::path& path) {
  const std::string where = path.string();
  const OpenedFile opened(path);
  const VdbReader file(opened, verify_map_trailer(opened, where, kMapFileVersion), where);
  ExaminedMap examined{read_map(file, where), {}, 0};
  examined.faults = verify(examined.map);
  for (MapFault& fault : view_faults(file, examined.map, examined.views)) examined.faults.push_back(std::move(fault));
  return examined;
}

}  // namespace felt
