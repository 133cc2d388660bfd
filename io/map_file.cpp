#include "io/map_file.h"

#include <openvdb/openvdb.h>

#include <vector>

#include "core/error.h"
#include "io/map_grids.h"
#include "io/map_metadata.h"
#include "io/map_trailer.h"
#include "io/vdb_file.h"
#include "mapping/touch_update.h"
#include "mapping/vdb_state.h"
#include "mapping/vdb_touch.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

template <typename Grid>
typename Grid::Ptr read_grid(openvdb::io::File& file, const std::string& name, const std::string& where) {
  if (!file.hasGrid(name)) throw FormatError(describe_mismatch(where, "grids", "one named '" + name + "'", "none"));
  const openvdb::GridBase::Ptr grid = file.readGrid(name);
  auto typed = openvdb::gridPtrCast<Grid>(grid);
  if (typed == nullptr)
    throw FormatError(describe_mismatch(where, "grid '" + name + "'", "type " + Grid::gridType(), grid->type()));
  return typed;
}

Map read_map(const fs::path& path) {
  const std::string where = path.string();
  openvdb::io::File file(where);
  file.setCopyMaxBytes(0);
  file.open(/*delayLoad=*/false);
  const MapHeader header = read_metadata(*file.getMetadata(), where);
  Map map(header.voxel_size_m, header.truncation_m);
  map.classes = header.classes;
  map.frames = header.frames;
  map.metadata = header.metadata;
  add_geometry(map, *read_grid<openvdb::FloatGrid>(file, "tsdf", where),
               *read_grid<openvdb::FloatGrid>(file, "weight", where));
  if (file.hasGrid("color_count"))
    add_color(map, *read_grid<openvdb::Vec3SGrid>(file, "color", where),
              *read_grid<openvdb::Int32Grid>(file, "color_count", where));
  for (int slot = 0; slot < map.classes.size(); ++slot)
    if (const std::string name = evidence_name(map, slot); file.hasGrid(name))
      add_evidence(map, slot, *read_grid<openvdb::FloatGrid>(file, name, where));
  map.properties = header.properties;
  map.touches = header.touches;
  for (Touch& touch : map.touches.touches) {
    if (!map.properties.index_of(touch.request.property))
      throw FormatError(describe_mismatch(where, "touch " + id_text(touch.id), "a property of the map's table",
                                          "'" + touch.request.property + "'"));
    touch.region = region_of(*read_grid<openvdb::MaskGrid>(file, touch_region_name(touch), where));
  }
  rebuild_touch_planes(map);
  if (const std::string hash = map_hash(map); hash != header.hash)
    throw FormatError(describe_mismatch(where, "map hash", header.hash, hash));
  return map;
}

}  // namespace

void save_map(const Map& map, const fs::path& path, const SaveOptions& options) {
  openvdb::initialize();
  const std::vector<MapGrid> grids = map_grids(map);
  const std::string hash = map_hash(map);
  VdbFile file(path, to_metadata(map, hash), grids.size(), hash);
  for (const MapGrid& grid : grids) file.write(*grid.make(), options.compression, grid.noisy);
  file.flush();
  file.commit(make_map_trailer(file.written(), kMapFileVersion));
}

Map load_map(const fs::path& path) {
  openvdb::initialize();
  verify_map_trailer(path, kMapFileVersion);
  try {
    return read_map(path);
  } catch (const openvdb::Exception& error) {
    throw FormatError(path.string() + ": OpenVDB cannot read it: " + error.what());
  }
}

}  // namespace felt
