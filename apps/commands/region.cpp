#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "apps/options/touch_options.h"
#include "apps/output/belief_report.h"
#include "apps/output/output_files.h"
#include "core/error.h"
#include "io/map_file/map_file.h"
#include "io/meshes/mesh_io.h"
#include "mapping/surface/region_mesh.h"

namespace felt::apps {
namespace {

using json = nlohmann::ordered_json;

struct RegionCommandOptions : CommonOptions {
  std::string map, at, mesh, properties;
  std::optional<double> below;
  bool overwrite = false;
  RegionOptions region;
};

/// Before any work: the mesh can be written, and replaces neither the map nor, without being told to, another file.
void check_mesh(const RegionCommandOptions& options) {
  if (options.mesh.empty()) return;
  require_mesh_name(options.mesh);
  if (std::filesystem::weakly_canonical(options.mesh) == std::filesystem::weakly_canonical(options.map))
    throw ConfigError(describe_mismatch("--mesh", "file", "another one than the map that is read", options.mesh));
  require_no_file(options.mesh, options.overwrite);
}

int run_region(const RegionCommandOptions& options) {
  check_mesh(options);
  Map map = load_map(options.map);
  const RegionSettings settings = options.region.resolved(map);
  use_properties(map, options.properties);
  const Contact contact = find_contact(map, point_of(options.at), settings);
  const Region region = options.region.region_at(map, contact, settings);
  const RegionSummary summary = summarize(map, region, settings);
  const Belief belief = Beliefs(map).of(region, covering_touches(map, region));
  if (!options.mesh.empty()) write_mesh(options.mesh, region_mesh(map, region));
  if (options.json) {
    json out = summary_json(map, summary);
    out["contact"] = {{"point_m", point_json(contact.point_m)},
                      {"surface_m", point_json(contact.surface_m)},
                      {"distance_m", contact.distance_m},
                      {"normal", point_json(contact.normal)}};
    out["rule"] = rule_name(settings.rule);
    if (settings.rule == RegionRule::connected) out["normal_limit_deg"] = normal_limit_deg(map, contact, settings);
    out["belief"] = belief_json(map, belief, options.below);
    print_json(out);
    return kDone;
  }
  std::printf("%zu voxels in %zu blocks, %.3f m2, from (%.3f, %.3f, %.3f) to (%.3f, %.3f, %.3f) m\n", summary.voxels,
              summary.blocks, summary.area_m2, summary.min_m.x(), summary.min_m.y(), summary.min_m.z(),
              summary.max_m.x(), summary.max_m.y(), summary.max_m.z());
  for (int c = 0; c < map.classes.size(); ++c)
    if (summary.class_voxels[size_t(c)] > 0)
      std::printf("  %s: %zu voxels\n", map.classes.at_slot(c).name.c_str(), summary.class_voxels[size_t(c)]);
  std::printf("  believed: %s\n%s", belief_text(map, belief).c_str(),
              property_text(belief_json(map, belief, options.below)).c_str());
  for (const std::string& warning : summary.warnings) std::printf("  warning: %s\n", warning.c_str());
  return kDone;
}

}  // namespace

void add_region(CLI::App& app) {
  auto options = std::make_shared<RegionCommandOptions>();
  CLI::App& command = add_command(app,
                                  {"region", "Show the region that a touch at a point would update",
                                   "feltmap region map.vdb --at 0.4,1.2,0.0 --mesh floor.ply\nfeltmap region map.vdb "
                                   "--at 0.4,1.2,0.0 --below 0.25"},
                                  *options, [options] { return run_region(*options); });
  command.add_option("MAP", options->map, "Map file")->required();
  command.add_option("--at", options->at, "World point, metres: x,y,z")->check(check_point)->required();
  CLI::Option* mesh = command.add_option("--mesh", options->mesh, "Write the region's surface (.ply, .obj, .glb)");
  command.add_flag("--force", options->overwrite, "Replace a mesh that exists")->needs(mesh);
  command.add_option("--properties", options->properties,
                     "Property table (YAML), instead of the one that the map may have");
  command.add_option("--below", options->below, "Probability that a property is at most this")->check(finite());
  options->region.add_to(command);
}

}  // namespace felt::apps
