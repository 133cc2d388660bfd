#include "io/map_file.h"

#include <openvdb/openvdb.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <memory>
#include <vector>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/map_metadata.h"
#include "io/map_trailer.h"
#include "io/vdb_writer.h"
#include "mapping/touch_update.h"
#include "mapping/vdb_classes.h"
#include "mapping/vdb_state.h"
#include "mapping/vdb_touch.h"
#include "mapping/vdb_views.h"

namespace felt {
namespace fs = std::filesystem;
namespace {

uint32_t vdb_flags(MapCompression compression) {
  switch (compression) {
    case MapCompression::none:
      break;
    case MapCompression::blosc:
      return openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_BLOSC;
    case MapCompression::zip:
      return openvdb::io::COMPRESS_ACTIVE_MASK | openvdb::io::COMPRESS_ZIP;
  }
  return openvdb::io::COMPRESS_ACTIVE_MASK;
}

/// Which classes have a plane anywhere, by slot.
std::vector<int> observed_classes(const Map& map) {
  std::vector<bool> seen(size_t(map.classes.size()), false);
  for (const Block& block : map.store.blocks())
    if (block.geometry->observed())
      for (const EvidencePlane& plane : block.evidence) seen[plane.slot] = true;
  std::vector<int> slots;
  for (int slot = 0; slot < map.classes.size(); ++slot)
    if (seen[size_t(slot)]) slots.push_back(slot);
  return slots;
}

bool has_color(const Map& map) {
  for (const Block& block : map.store.blocks())
    if (block.color != nullptr) return true;
  return false;
}

std::string region_name(const Touch& touch) { return "touch_region/" + id_text(touch.id); }

using MakeGrid = std::function<openvdb::GridBase::Ptr()>;

/// Beliefs of maps with classes, and what of class state only few maps have.
void add_class_grids(const Map& map, const TouchViews& touched, std::vector<MakeGrid>& grids) {
  const auto any = [&](auto has) { return std::any_of(map.store.blocks().begin(), map.store.blocks().end(), has); };
  if (any([](const Block& b) { return b.geometry->observed() && b.even_evidence != nullptr; }))
    grids.push_back([&] { return even_evidence_grid(map); });
  if (any([](const Block& b) { return b.geometry->observed() && b.instance != nullptr; })) {
    grids.push_back([&] { return instance_grid(map); });
    grids.push_back([&] { return instance_votes_grid(map); });
  }
  if (map.classes.size() == 0) return;
  grids.push_back([&map, touched] { return label_grid(map, *touched); });
  grids.push_back([&map, touched] { return label_probability_grid(map, *touched); });
  grids.push_back([&map, touched] { return entropy_grid(map, *touched); });
  grids.push_back([&map] { return total_evidence_grid(map); });
}

/// One call for each grid of the file: made when it is written and gone afterwards, so that the file's size does not
/// decide about memory.
std::vector<MakeGrid> grids_of(const Map& map) {
  std::vector<MakeGrid> grids;
  grids.push_back([&] { return tsdf_grid(map); });
  grids.push_back([&] { return weight_grid(map); });
  if (has_color(map)) {
    grids.push_back([&] { return color_grid(map); });
    grids.push_back([&] { return color_count_grid(map); });
  }
  for (const int slot : observed_classes(map)) grids.push_back([&map, slot] { return evidence_grid(map, slot); });
  const auto touched = std::make_shared<const std::vector<TouchView>>(touch_views(map));
  add_class_grids(map, touched, grids);
  for (const Touch& touch : map.touches.touches)
    grids.push_back([&map, &touch] { return region_grid(map, touch.region, region_name(touch)); });
  for (NamedGrid& grid : touch_grids(map, touched)) grids.push_back(std::move(grid.make));
  return grids;
}

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
    if (const std::string name = "evidence/" + map.classes.at_slot(slot).name; file.hasGrid(name))
      add_evidence(map, slot, *read_grid<openvdb::FloatGrid>(file, name, where));
  if (file.hasGrid("evidence_even"))
    add_even_evidence(map, *read_grid<openvdb::FloatGrid>(file, "evidence_even", where));
  if (file.hasGrid("instance"))
    add_instances(map, *read_grid<openvdb::Int32Grid>(file, "instance", where),
                  *read_grid<openvdb::Int32Grid>(file, "instance_votes", where));
  map.properties = header.properties;
  map.touches = header.touches;
  for (Touch& touch : map.touches.touches) {
    if (!map.properties.index_of(touch.request.property))
      throw FormatError(describe_mismatch(where, "touch " + id_text(touch.id), "a property of the map's table",
                                          "'" + touch.request.property + "'"));
    touch.region = region_of(*read_grid<openvdb::MaskGrid>(file, region_name(touch), where));
  }
  rebuild_touch_planes(map);
  if (const std::string hash = map_hash(map); hash != header.hash)
    throw FormatError(describe_mismatch(where, "map hash", header.hash, hash));
  return map;
}

}  // namespace

void save_map(const Map& map, const fs::path& path, const SaveOptions& options) {
  openvdb::initialize();
  AtomicFile file(path);
  const auto failed = [&] { return IoError(path.string() + ": cannot write: " + std::strerror(errno)); };
  std::vector<char> buffer(1 << 20);
  std::ofstream os;
  os.rdbuf()->pubsetbuf(buffer.data(), std::streamsize(buffer.size()));
  os.open(file.path(), std::ios::binary | std::ios::in | std::ios::out);
  const auto grids = grids_of(map);
  const std::string hash = map_hash(map);
  VdbWriter writer(os, to_metadata(map, hash), int32_t(grids.size()), vdb_flags(options.compression), hash);
  for (const auto& make : grids) {
    writer.write(*make());
    // A full disk shows here, not after the remaining grids.
    if (!os.good()) throw failed();
  }
  if (!os.flush()) throw failed();
  os << make_map_trailer(file.path(), kMapFileVersion);
  os.close();
  if (!os) throw failed();
  file.commit();
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
