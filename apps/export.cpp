#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "apps/command.h"
#include "apps/commands.h"
#include "apps/exit_code.h"
#include "core/error.h"
#include "io/map_file.h"
#include "io/mesh_io.h"
#include "mapping/class_belief.h"
#include "mapping/crop.h"
#include "mapping/marching_cubes.h"

namespace felt::apps {
namespace {
namespace fs = std::filesystem;

struct ExportOptions {
  fs::path map, vdb, mesh, points;
  std::string color_by = "rgb", class_name;
  std::vector<double> box_m;  ///< x0 y0 z0 x1 y1 z1
  bool overwrite = false;
  CommonOptions common;
};

void check(const ExportOptions& o) {
  std::vector<std::string> problems;
  if (o.vdb.empty() && o.mesh.empty() && o.points.empty())
    problems.push_back(describe_mismatch("export", "what to write", "--vdb, --mesh or --points", "none of them"));
  if (o.color_by != "rgb" && o.color_by != "class" && o.color_by != "entropy")
    problems.push_back(describe_mismatch("--color-by", "colour", "rgb, class or entropy", '"' + o.color_by + '"'));
  if (!o.box_m.empty() && !(o.box_m[0] < o.box_m[3] && o.box_m[1] < o.box_m[4] && o.box_m[2] < o.box_m[5]))
    problems.push_back(describe_mismatch("--box", "corners in metres", "x0,y0,z0,x1,y1,z1 with x0 < x1 and so on",
                                         nlohmann::json(o.box_m).dump()));
  if (!problems.empty()) throw ConfigError(problems);
  for (const fs::path& file : {o.vdb, o.mesh, o.points})
    if (!file.empty() && fs::exists(file) && !o.overwrite)
      throw IoError(
          describe_mismatch(file.string(), "output exists", "no file there, or --force to replace it", "one"));
}

/// Beliefs at the voxel nearest to each vertex.
std::vector<ClassBelief> vertex_beliefs(const Map& map, const std::vector<VertexEdge>& edges) {
  std::vector<ClassBelief> beliefs;
  beliefs.reserve(edges.size());
  for (const VertexEdge& edge : edges) {
    Index3 voxel = edge.voxel;
    if (edge.t > 0.5f) (edge.axis == 0 ? voxel.x : edge.axis == 1 ? voxel.y : voxel.z) += 1;
    const Block* block = map.store.get(block_of_voxel(voxel));
    beliefs.push_back(block == nullptr ? ClassBelief{} : class_belief(*block, offset_in_block(voxel), map.classes));
  }
  return beliefs;
}

/// Black over red to yellow for t in [0, 1].
Rgba8 heat(float t) {
  const auto ramp = [](float x) { return uint8_t(255 * std::clamp(x, 0.0f, 1.0f) + 0.5f); };
  return {ramp(2 * t), ramp(2 * t - 1), 0, 255};
}

void color_mesh(TriangleMesh& mesh, const Map& map, const std::vector<ClassBelief>& beliefs, const std::string& by) {
  if (by == "rgb") return;
  constexpr Rgba8 kNothingKnown{128, 128, 128, 255};
  const float most = std::log(float(std::max(2, map.classes.size())));
  mesh.colors.resize(beliefs.size());
  for (size_t i = 0; i < beliefs.size(); ++i) {
    if (beliefs[i].slot == ClassTable::kNoSlot) {
      mesh.colors[i] = kNothingKnown;
    } else {
      mesh.colors[i] = by == "class" ? map.classes.at_slot(beliefs[i].slot).color : heat(beliefs[i].entropy / most);
    }
  }
}

/// The triangles whose three corners are in `keep`, and the vertices that they use.
TriangleMesh part_of(const TriangleMesh& mesh, const std::vector<bool>& keep) {
  constexpr uint32_t kUnused = 0xffffffff;
  std::vector<uint32_t> number(mesh.positions.size(), kUnused);
  TriangleMesh part;
  for (const Triangle& triangle : mesh.triangles) {
    if (!keep[triangle[0]] || !keep[triangle[1]] || !keep[triangle[2]]) continue;
    Triangle renumbered;
    for (int corner = 0; corner < 3; ++corner) {
      const uint32_t vertex = triangle[corner];
      if (number[vertex] == kUnused) {
        number[vertex] = uint32_t(part.positions.size());
        part.positions.push_back(mesh.positions[vertex]);
        if (!mesh.normals.empty()) part.normals.push_back(mesh.normals[vertex]);
        if (!mesh.colors.empty()) part.colors.push_back(mesh.colors[vertex]);
        if (!mesh.labels.empty()) part.labels.push_back(mesh.labels[vertex]);
      }
      renumbered[corner] = number[vertex];
    }
    part.triangles.push_back(renumbered);
  }
  return part;
}

TriangleMesh surface(const Map& map, const ExportOptions& o) {
  std::vector<VertexEdge> edges;
  TriangleMesh mesh = extract_mesh(map, {}, &edges);
  if (map.classes.empty()) return mesh;
  const std::vector<ClassBelief> beliefs = vertex_beliefs(map, edges);
  color_mesh(mesh, map, beliefs, o.color_by);
  mesh.labels.reserve(beliefs.size());
  for (const ClassBelief& belief : beliefs)
    mesh.labels.push_back(belief.slot == ClassTable::kNoSlot ? 0 : map.classes.at_slot(belief.slot).id);
  if (o.class_name.empty()) return mesh;
  const int slot = *map.classes.slot_of_name(o.class_name);
  std::vector<bool> keep(beliefs.size());
  for (size_t i = 0; i < beliefs.size(); ++i) keep[i] = beliefs[i].slot == slot;
  return part_of(mesh, keep);
}

void check_classes(const Map& map, const ExportOptions& o) {
  if (o.class_name.empty() && o.color_by == "rgb") return;
  if (map.classes.empty())
    throw ConfigError(
        describe_mismatch(o.map.string(), "--class and --color-by class or entropy", "a map with classes", "none"));
  if (o.class_name.empty() || map.classes.slot_of_name(o.class_name)) return;
  std::string names;
  for (int slot = 0; slot < map.classes.size(); ++slot) names += (slot ? ", " : "") + map.classes.at_slot(slot).name;
  throw ConfigError(
      describe_mismatch("--class", "class of " + o.map.string(), "one of " + names, '"' + o.class_name + '"'));
}

int run(const ExportOptions& o) {
  check(o);
  Map map = load_map(o.map);
  check_classes(map, o);
  if (!o.box_m.empty())
    map = cropped(map, Eigen::AlignedBox3d(Eigen::Vector3d::Map(o.box_m.data()), Eigen::Vector3d::Map(&o.box_m[3])));
  nlohmann::ordered_json written = nlohmann::ordered_json::object();
  if (!o.vdb.empty()) {
    save_map(map, o.vdb);
    written["vdb"] = {{"path", o.vdb.string()}, {"active_voxels", active_voxel_count(map)}};
  }
  if (!o.mesh.empty() || !o.points.empty()) {
    TriangleMesh mesh = surface(map, o);
    if (!o.mesh.empty()) {
      write_mesh(o.mesh, mesh);
      written["mesh"] = {
          {"path", o.mesh.string()}, {"vertices", mesh.positions.size()}, {"triangles", mesh.triangles.size()}};
    }
    if (!o.points.empty()) {
      mesh.triangles.clear();
      write_mesh(o.points, mesh);
      written["points"] = {{"path", o.points.string()}, {"points", mesh.positions.size()}};
    }
  }
  if (o.common.json) {
    std::printf("%s\n", written.dump(2).c_str());
  } else if (!o.common.quiet) {
    for (const auto& [kind, what] : written.items()) std::printf("%s\n", what.at("path").get<std::string>().c_str());
  }
  return kDone;
}

}  // namespace

void add_export(CLI::App& app) {
  auto o = std::make_shared<ExportOptions>();
  CLI::App& command = add_command(app,
                                  {"export", "Write meshes, points and grids of a map or a part of it",
                                   "feltmap export result/map.vdb --mesh sofa.glb --class sofa\n"
                                   "feltmap export result/map.vdb --vdb part.vdb --box 0,0,0,2,2,1.5"},
                                  o->common, [o] { return run(*o); });
  command.add_option("MAP", o->map, "A map file")->required();
  command.add_option("--mesh", o->mesh, "Surface mesh, by extension: .ply, .glb or .obj");
  command.add_option("--points", o->points, "The mesh's vertices with normals and colours: .ply");
  command.add_option("--vdb", o->vdb, "Map file of the part");
  command.add_option("--color-by", o->color_by, "rgb, class or entropy")->capture_default_str();
  command.add_option("--class", o->class_name,
                     "Only the surface whose most probable class this is (meshes and points)");
  command.add_option("--box", o->box_m, "Only what lies in x0,y0,z0,x1,y1,z1, metres")->delimiter(',')->expected(6);
  command.add_flag("--force", o->overwrite, "Replace files that exist");
}

}  // namespace felt::apps
