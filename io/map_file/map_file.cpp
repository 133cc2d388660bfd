#include "io/map_file/map_file.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <utility>
#include <vector>

#include "core/error.h"
#include "io/files/opened_file.h"
#include "io/map_file/map_grids.h"
#include "io/map_file/map_metadata.h"
#include "io/map_file/map_trailer.h"
#include "io/map_file/vdb_reader.h"
#include "io/map_file/vdb_writer.h"
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

void load_geometry(const VdbReader& file, const std::string& where, Map& map) {
  file.read<float>("tsdf", [&](const VdbLeaf<float>& leaf) {
    std::copy_n(leaf.values, kBlockVoxels, map.store[map.store.find_or_create(leaf.coord)].geometry->tsdf);
  });
  size_t leaves = 0;
  file.read<float>("weight", [&](const VdbLeaf<float>& leaf) {
    std::copy_n(leaf.values, kBlockVoxels, block_of_leaf(map, leaf.coord, "weight", where).geometry->weight);
    ++leaves;
  });
  require_leaves(leaves, map.store.size(), "weight", where);
}

/// The exact inverse of color_grid's scale: a 16-bit value survives the trip through float.
uint16_t stored_color(float value) {
  return value > 0 ? uint16_t(int32_t(std::min(value * (255.0f * 256), 65535.0f) + 0.5f)) : uint16_t(0);
}

void load_color(const VdbReader& file, const std::string& where, Map& map) {
  size_t colored = 0, leaves = 0;
  file.read<int32_t>("color_count", [&](const VdbLeaf<int32_t>& leaf) {
    ColorPlanes& planes = map.store.add_color(block_of_leaf(map, leaf.coord, "color_count", where));
    for (int i = 0; i < kBlockVoxels; ++i) planes.count[i] = u16_of(leaf.values[i], where, "color_count", leaf.coord);
    ++colored;
  });
  file.read<openvdb::Vec3s>("color", [&](const VdbLeaf<openvdb::Vec3s>& leaf) {
    // Blocks without colour have a leaf here too: the grid's topology is that of `tsdf`.
    ColorPlanes* planes = block_of_leaf(map, leaf.coord, "color", where).color;
    if (planes == nullptr) return;
    for (int i = 0; i < kBlockVoxels; ++i) {
      const openvdb::Vec3s& rgb = leaf.values[i];
      planes->r[i] = stored_color(rgb.x());
      planes->g[i] = stored_color(rgb.y());
      planes->b[i] = stored_color(rgb.z());
    }
    ++leaves;
  });
  require_leaves(leaves, colored, "color", where);
}

/// Classes in ascending order of slot.
void load_evidence(const VdbReader& file, const std::string& where, Map& map) {
  for (int slot = 0; slot < map.classes.size(); ++slot) {
    const std::string name = evidence_name(map, slot);
    if (!file.has(name)) continue;
    file.read<float>(name, [&](const VdbLeaf<float>& leaf) {
      Block& block = block_of_leaf(map, leaf.coord, name, where);
      Plane* plane = map.store.new_plane();
      std::copy_n(leaf.values, kBlockVoxels, plane->value);
      block.evidence.push_back({uint16_t(slot), plane});
    });
  }
}

void load_even_evidence(const VdbReader& file, const std::string& where, Map& map) {
  file.read<float>("evidence_even", [&](const VdbLeaf<float>& leaf) {
    Block& block = block_of_leaf(map, leaf.coord, "evidence_even", where);
    block.even_evidence = map.store.new_plane();
    std::copy_n(leaf.values, kBlockVoxels, block.even_evidence->value);
  });
}

void load_instances(const VdbReader& file, const std::string& where, Map& map) {
  size_t instances = 0, leaves = 0;
  const auto load = [&](const char* name, uint16_t(InstancePlanes::*plane)[kBlockVoxels], size_t& count) {
    file.read<int32_t>(name, [&](const VdbLeaf<int32_t>& leaf) {
      Block& block = block_of_leaf(map, leaf.coord, name, where);
      if (&count == &leaves && block.instance == nullptr)
        fail_leaf(where, name, leaf.coord, "a leaf of 'instance' there", "none");
      InstancePlanes& planes = map.store.add_instance(block);
      for (int i = 0; i < kBlockVoxels; ++i) (planes.*plane)[i] = u16_of(leaf.values[i], where, name, leaf.coord);
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
  load_geometry(file, where, map);
  if (file.has("color_count")) load_color(file, where, map);
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

MapJournals load_journals(const fs::path& path) {
  const std::string where = path.string();
  const OpenedFile opened(path);
  MapHeader header =
      read_metadata(VdbReader(opened, verify_map_trailer(opened, where, kMapFileVersion), where).metadata(), where);
  return {header.voxel_size_m, std::move(header.classes), std::move(header.properties), std::move(header.frames),
          std::move(header.touches)};
}

Map load_map(const fs::path& path) {
  // Opened once: another program may replace the file meanwhile.
  const std::string where = path.string();
  const OpenedFile opened(path);
  return read_map(VdbReader(opened, verify_map_trailer(opened, where, kMapFileVersion), where), where);
}

}  // namespace felt
