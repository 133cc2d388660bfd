#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/commands.h"
#include "apps/exit_code.h"
#include "apps/number_checks.h"
#include "apps/touch_options.h"
#include "io/map_file/map_file.h"
#include "io/readings/mask_image.h"

namespace felt::apps {
namespace {

using json = nlohmann::ordered_json;

struct QueryOptions : CommonOptions {
  std::string map, file, properties;
  std::vector<std::string> at;
  std::optional<double> below;
};

bool has_instances(const Map& map) {
  return std::ranges::any_of(map.store.blocks(), [](const Block& b) { return b.instance != nullptr; });
}

/// The thing that a voxel belongs to: the id that leads the votes, and by how much; null where none does.
json instance_json(const Block& block, int offset) {
  if (block.instance == nullptr || block.instance->votes[offset] == 0) return nullptr;
  return {{"id", block.instance->id[offset]}, {"votes", block.instance->votes[offset]}};
}

json answer(const Map& map, Beliefs& beliefs, const Eigen::Vector3d& point, std::optional<double> below,
            bool instances) {
  json out;
  out["point_m"] = point_json(point);
  const Eigen::Vector3d q = point / map.voxel_size_m;
  if (!q.allFinite() || q.array().abs().maxCoeff() > 1e9) {
    out["reason"] = "not a point of a map";
    return out;
  }
  const Index3 voxel{int32_t(std::lround(q.x())), int32_t(std::lround(q.y())), int32_t(std::lround(q.z()))};
  const Block* block = map.store.get(block_of_voxel(voxel));
  const float weight = block == nullptr ? 0.0f : block->geometry->weight[offset_in_block(voxel)];
  out["voxel"] = {voxel.x, voxel.y, voxel.z};
  out["weight"] = weight;
  if (!(weight > 0)) {
    out["signed_distance_m"] = nullptr;
    out["reason"] = "never observed";
    return out;
  }
  const double trilinear = double(sample_tsdf(map, point.x(), point.y(), point.z()));
  out["signed_distance_m"] = std::isnan(trilinear) ? double(block->geometry->tsdf[offset_in_block(voxel)]) : trilinear;
  out.update(belief_json(map, beliefs.at(voxel), below));
  if (instances) out["instance"] = instance_json(*block, offset_in_block(voxel));
  return out;
}

int run_query(const QueryOptions& options) {
  Map map = load_map(options.map);
  use_properties(map, options.properties);
  std::vector<Eigen::Vector3d> points;
  for (const std::string& at : options.at) points.push_back(point_of(at));
  if (!options.file.empty())
    for (const Eigen::Vector3d& p : read_points(options.file)) points.push_back(p);
  Beliefs beliefs(map);
  const bool instances = has_instances(map);
  json all = json::array();
  for (const Eigen::Vector3d& point : points) all.push_back(answer(map, beliefs, point, options.below, instances));
  if (options.json) {
    print_json(json{{"points", all}});
    return kDone;
  }
  for (size_t i = 0; i < points.size(); ++i) {
    const json& a = all[i];
    std::printf("(%.3f, %.3f, %.3f): ", points[i].x(), points[i].y(), points[i].z());
    if (a.contains("reason")) {
      std::printf("%s\n", a["reason"].get<std::string>().c_str());
      continue;
    }
    std::printf("distance %.4f m, weight %g", a["signed_distance_m"].get<double>(), a["weight"].get<double>());
    if (a.contains("class"))
      std::printf(", %s %.3f, entropy %.3f", a["class"].get<std::string>().c_str(),
                  a["class_probability"][a["class"].get<std::string>()].get<double>(),
                  a["class_entropy"].get<double>());
    if (a.contains("instance"))
      std::printf(", %s", a["instance"].is_null() ? "no instance" : ("instance " + a["instance"]["id"].dump()).c_str());
    std::printf("\n%s", property_text(a).c_str());
  }
  return kDone;
}

}  // namespace

void add_query(CLI::App& app) {
  auto options = std::make_shared<QueryOptions>();
  CLI::App& command = add_command(app,
                                  {"query", "Answer what the map believes at points",
                                   "feltmap query map.vdb --at 0.4,1.2,0.0 --at 1,1,0 --below 0.25\n"
                                   "feltmap query map.vdb --file points.csv --json"},
                                  *options, [options] { return run_query(*options); });
  command.add_option("map", options->map, "Map file")->required();
  CLI::Option_group& where = *command.add_option_group("Where");
  where.require_option(1, 2);
  where.add_option("--at", options->at, "World point, metres: x,y,z; may be repeated")
      ->check(check_point)
      ->allow_extra_args(false);
  where.add_option("--file", options->file, "Points: one x,y,z a line");
  command.add_option("--properties", options->properties, "Property table (YAML), for a map that has none");
  command.add_option("--below", options->below, "Probability that a property is at most this")->check(finite());
}

}  // namespace felt::apps
