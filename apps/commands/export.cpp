#include <spdlog/spdlog.h>

#include <Eigen/Geometry>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/fusion/checkpoint.h"
#include "apps/options/problems.h"
#include "apps/options/touch_options.h"
#include "apps/output/output_files.h"
#include "core/error.h"
#include "io/map_file/map_file.h"
#include "io/map_file/map_grids.h"
#include "io/meshes/mesh_io.h"
#include "mapping/maps/crop.h"
#include "mapping/regions/region_query.h"
#include "mapping/surface/marching_cubes.h"
#include "mapping/surface/mesh_part.h"
#include "mapping/surface/surface_color.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;
using json = nlohmann::ordered_json;

struct ExportOptions : CommonOptions {
  fs::path map, vdb, mesh, points, html;
  std::string color_by = "rgb", class_name, segment_at, properties, up = "+z";
  std::vector<double> box_m;  ///< x0 y0 z0 x1 y1 z1
  std::vector<std::string> grids;
  bool half = false, compact = false, overwrite = false;
  RegionOptions segment;
  CLI::Option *color_by_option = nullptr, *up_option = nullptr;
};

void check(const ExportOptions& o) {
  if (o.vdb.empty() && o.mesh.empty() && o.points.empty() && o.html.empty())
    throw CLI::RequiredError("--vdb, --mesh, --points or --html");
  Problems problems;
  if (o.vdb.empty() && (o.half || o.compact || !o.grids.empty()))
    problems.add_of_usage(describe_mismatch("--grids, --half, --compact", "what to write", "--vdb FILE", "no --vdb"));
  if (o.mesh.empty() && o.points.empty() && o.html.empty() && o.color_by_option->count() > 0)
    problems.add_of_usage(describe_mismatch("--color-by", "what to write", "--mesh, --points or --html", "none"));
  if (o.html.empty() && o.up_option->count() > 0)
    problems.add_of_usage(describe_mismatch("--up", "what to write", "--html FILE", "no --html"));
  for (const fs::path& file : {o.mesh, o.points})
    if (!file.empty()) problems.attempt([&] { require_mesh_name(file); });
  if (o.compact && (o.half || !o.grids.empty()))
    problems.add(describe_mismatch("--compact", "a map file", "neither --grids nor --half", "one of them"));
  if (!o.box_m.empty() && !(o.box_m[0] < o.box_m[3] && o.box_m[1] < o.box_m[4] && o.box_m[2] < o.box_m[5]))
    problems.add(describe_mismatch("--box", "corners in metres", "x0,y0,z0,x1,y1,z1 with x0 < x1 and so on",
                                   nlohmann::json(o.box_m).dump()));
  // A whole map may be written anew in its place (--compact); a part, or a picture of it, would be all that is left.
  const bool whole = o.class_name.empty() && o.box_m.empty() && o.segment_at.empty() && !o.half && o.grids.empty();
  std::map<fs::path, std::string> uses = {{fs::weakly_canonical(o.map), "the map that is read"}};
  for (const fs::path& other : {fs::path(o.properties), fs::path(o.segment.mask)})
    if (!other.empty()) uses.emplace(fs::weakly_canonical(other), "a file that is read");
  if (whole && !o.vdb.empty() && fs::weakly_canonical(o.vdb) == fs::weakly_canonical(o.map))
    uses.erase(fs::weakly_canonical(o.map));
  for (const auto& [option, file] :
       {std::pair("--vdb", o.vdb), {"--mesh", o.mesh}, {"--points", o.points}, {"--html", o.html}})
    if (!file.empty())
      // Absolute first: of a file that does not exist yet, "out.ply" and "./out.ply" stay two names otherwise.
      if (const auto [other, is_new] = uses.emplace(fs::weakly_canonical(fs::absolute(file)), option); !is_new)
        problems.add(describe_mismatch(option, "file", "another one than " + other->second, file.string()));
  problems.throw_if_any();
  for (const fs::path& file : {o.vdb, o.mesh, o.points, o.html}) {
    if (file.empty()) continue;
    require_no_file(file, o.overwrite);
    if (file.has_parent_path() && !fs::is_directory(file.parent_path()))
      throw IoError(describe_mismatch(file.string(), "folder to write to", "one that exists", "none"));
  }
}

int slot_of_class(const Map& map, const ExportOptions& o) {
  if (const auto slot = map.classes.slot_of_name(o.class_name)) return *slot;
  std::string names;
  for (int slot = 0; slot < map.classes.size(); ++slot) names += (slot ? ", " : "") + map.classes.at_slot(slot).name;
  throw ConfigError(describe_mismatch("--class", "class of " + o.map.string(),
                                      names.empty() ? "a map with classes" : "one of " + names,
                                      '"' + o.class_name + '"'));
}

/// The part of a map that was asked for: what its limits have in common.
struct Part {
  std::optional<Eigen::AlignedBox3d> box_m;
  std::optional<Region> things;  ///< of --class and --segment-at
  std::optional<Region> voxels;  ///< all limits together; nothing where the whole map was asked for
};

Part part_of_map(const Map& map, const ExportOptions& o) {
  Part part;
  const auto only = [](std::optional<Region>& limited, const Region& region) {
    limited = limited ? intersected(*limited, region) : region;
  };
  if (!o.class_name.empty()) only(part.things, voxels_of_class(map, slot_of_class(map, o)));
  if (!o.segment_at.empty()) {
    const RegionSettings settings = o.segment.resolved(map);
    const Contact contact = find_contact(map, point_of(o.segment_at), settings);
    only(part.things, o.segment.region_at(map, contact, settings));
  }
  part.voxels = part.things;
  if (!o.box_m.empty()) {
    part.box_m.emplace(Eigen::Vector3d::Map(o.box_m.data()), Eigen::Vector3d::Map(&o.box_m[3]));
    only(part.voxels, voxels_in(map, *part.box_m));
  }
  return part;
}

/// The surface may lie in a box, and no centre of a voxel.
bool reaches(const Map& map, const Part& part) {
  if (!part.box_m) return part.voxels->voxels() > 0;
  const Eigen::Vector3d voxel = Eigen::Vector3d::Constant(map.voxel_size_m);
  const Region near = voxels_in(map, {part.box_m->min() - voxel, part.box_m->max() + voxel});
  return (part.things ? intersected(*part.things, near) : near).voxels() > 0;
}

json write_vdb(const Map& map, const Region* part, const ExportOptions& o) {
  json written = {{"path", o.vdb.string()}};
  if (o.grids.empty() && !o.half) {
    const Map& whole = map;
    Map some = part == nullptr ? Map(map.voxel_size_m, map.truncation_m) : cropped(map, *part);
    forget_progress(some);
    const Map& saved = part == nullptr ? whole : some;
    save_map(saved, o.vdb, o.compact ? SaveOptions{MapCompression::zip, false} : SaveOptions{});
    written["active_voxels"] = active_voxel_count(saved);
  } else {
    const ExportedGrids grids = export_vdb(map, o.vdb, {.grids = o.grids, .half = o.half, .part = part});
    written["grids"] = grids.names;
    if (o.half) written["in_32_bits"] = grids.in_32_bits;
    for (const std::string& grid : grids.in_32_bits)
      spdlog::warn("{}: grid '{}': written in 32 bits, as 16 hold no numbers beyond 65504 and few digits below 6e-5",
                   o.vdb.string(), grid);
  }
  written["bytes"] = fs::file_size(o.vdb);
  return written;
}

/// What was asked for may hold voxels and no surface: between two faces of a thing, or narrower than a triangle.
void warn_if_empty(const fs::path& file, size_t count, const char* what) {
  if (!file.empty() && count == 0)
    spdlog::warn("{}: empty: no {} of the surface lies in what was asked for", file.string(), what);
}

json write_surface(const Map& map, const Part& part, const SurfaceColor& color, const ExportOptions& o) {
  std::vector<VertexEdge> edges;
  TriangleMesh mesh = extract_mesh(map, {}, &edges);
  attach_beliefs(map, edges, mesh);
  const std::optional<ColorRange> range = color_surface(map, edges, color, mesh);
  // A vertex belongs to the thing of its nearest voxel, and lies in the box or not by its own position.
  std::vector<bool> inside(edges.size(), true);
  for (size_t i = 0; i < edges.size(); ++i)
    inside[i] = (!part.things || part.things->contains(nearest_voxel(edges[i]))) &&
                (!part.box_m || part.box_m->contains(mesh.positions[i].cast<double>()));
  TriangleMesh points;
  if (!o.points.empty()) points = points_of(mesh, [&](uint32_t vertex) { return inside[vertex]; });
  if (part.voxels)
    mesh = part_of(mesh, [&](const Triangle& t) { return inside[t[0]] && inside[t[1]] && inside[t[2]]; });
  json written = json::object();
  warn_if_empty(o.mesh, mesh.triangles.size(), "triangle");
  warn_if_empty(o.html, mesh.triangles.size(), "triangle");
  warn_if_empty(o.points, points.positions.size(), "vertex");
  const bool only_points = o.mesh.empty() && o.html.empty();
  warn_if_coarse(only_points ? points : mesh, only_points ? o.points : !o.mesh.empty() ? o.mesh : o.html);
  if (!o.mesh.empty()) {
    write_mesh(o.mesh, mesh);
    written["mesh"] = {
        {"path", o.mesh.string()}, {"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}};
  }
  if (!o.html.empty()) {
    write_html(o.html, mesh, o.map.string() + (o.color_by == "rgb" ? "" : ", " + o.color_by), o.up);
    written["html"] = {{"path", o.html.string()}, {"bytes", fs::file_size(o.html)}};
  }
  if (!o.points.empty()) {
    write_mesh(o.points, points);
    written["points"] = {{"path", o.points.string()}, {"points", points.positions.size()}};
  }
  if (range) written["colors"] = {{"by", o.color_by}, {"black", range->low}, {"yellow", range->high}};
  return written;
}

int run(const ExportOptions& o) {
  check(o);
  // From before the map is read, which may be the one that is written anew.
  std::optional<MapWriting> writing;
  if (!o.vdb.empty()) {
    writing.emplace(o.vdb, o.overwrite);
    require_no_file(o.vdb, o.overwrite);  // others may have made one while this waited
  }
  Map map = load_map(o.map);
  use_properties(map, o.properties);
  const SurfaceColor color = parse_surface_color(o.color_by, map);
  const Part part = part_of_map(map, o);
  if (part.voxels && (o.vdb.empty() ? !reaches(map, part) : part.voxels->voxels() == 0))
    throw ConfigError(describe_mismatch(o.map.string(), "part to export", "at least one voxel of the map", "none"));
  json written = json::object();
  if (!o.vdb.empty()) written["vdb"] = write_vdb(map, part.voxels ? &*part.voxels : nullptr, o);
  if (!o.mesh.empty() || !o.points.empty() || !o.html.empty()) written.update(write_surface(map, part, color, o));
  if (o.json) {
    print_json(written);
  } else if (!o.quiet) {
    for (const auto& [kind, what] : written.items()) {
      if (kind == "colors")
        std::printf("%s from %g (black) to %g (yellow), grey where nothing is known\n", o.color_by.c_str(),
                    what.at("black").get<double>(), what.at("yellow").get<double>());
      else
        std::printf("%s\n", what.at("path").get<std::string>().c_str());
    }
  }
  return kDone;
}

}  // namespace

void add_export(CLI::App& app) {
  auto o = std::make_shared<ExportOptions>();
  CLI::App& command = add_command(app,
                                  {"export", "Write meshes, points and grids of a map or a part of it",
                                   "feltmap export result/map.vdb --mesh sofa.glb --class sofa\n"
                                   "feltmap export result/map.vdb --mesh felt.glb --color-by friction.mean\n"
                                   "feltmap export result/map.vdb --html map.html --color-by class\n"
                                   "feltmap export result/map.vdb --points door.ply --segment-at 1.2,0.4,1.0\n"
                                   "feltmap export result/map.vdb --vdb part.vdb --box 0,0,0,2,2,1.5\n"
                                   "feltmap export result/map.vdb --vdb view.vdb --grids tsdf,color,evidence/ --half"},
                                  *o, [o] { return run(*o); });
  command.add_option("MAP", o->map, "A map file")->required();
  command.add_option("--mesh", o->mesh, "Surface mesh, by extension: .ply, .glb or .obj");
  command.add_option("--points", o->points, "The mesh's vertices with normals and colours, by extension as --mesh");
  command.add_option("--html", o->html, "A page that shows the mesh in a browser, without a network");
  o->up_option =
      command.add_option("--up", o->up, "Axis of the map that points up on that page at first: +x, -x, +y, ... -z")
          ->check(CLI::IsMember({"+x", "-x", "+y", "-y", "+z", "-z"}))
          ->capture_default_str();
  command.add_option("--vdb", o->vdb, "Map file of the part; with --grids or --half a file of grids for viewing");
  command.add_option("--grids", o->grids, "Grids to write, by name; evidence/ stands for all that begin so")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->option_text("NAME,...");
  command.add_flag("--half", o->half, "Store floats in 16 bits, but for grids that these cannot hold");
  command.add_flag("--compact", o->compact, "A map file of least size: DEFLATE, and no grids that only viewers need");
  o->color_by_option =
      command.add_option("--color-by", o->color_by, "rgb, class, entropy, <property>.mean or <property>.sd")
          ->capture_default_str();
  command.add_option("--properties", o->properties, "Property table (YAML), instead of the one that the map may have");
  const char* part = "Part (several: what they have in common)";
  command.add_option("--class", o->class_name, "Only where this is the most probable class")->group(part);
  command.add_option("--box", o->box_m, "Only what lies in x0,y0,z0,x1,y1,z1, metres")
      ->delimiter(',')
      ->expected(6)
      ->allow_extra_args(false)
      ->group(part);
  CLI::Option* segment_at = command.add_option("--segment-at", o->segment_at,
                                               "Only the region that a touch at x,y,z would update (options as there)");
  segment_at->check(check_point)->group(part);
  command.add_flag("--force", o->overwrite, "Replace files that exist");
  for (CLI::Option* option : o->segment.add_to(command)) option->needs(segment_at);
}

}  // namespace felt::apps
