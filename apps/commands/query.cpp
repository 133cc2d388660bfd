#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "apps/command.h"
#include "apps/commands/commands.h"
#include "apps/exit_code.h"
#include "apps/options/number_checks.h"
#include "apps/options/touch_options.h"
#include "apps/output/belief_report.h"
#include "core/text.h"
#include "io/map_file/map_file.h"
#include "io/readings/points.h"

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

/// What is known of a point without beliefs; `voxel`: the observed voxel whose belief is to be added, if there is one.
json geometry_json(const Map& map, const Eigen::Vector3d& point, bool instances, std::optional<Index3>& voxel) {
  json out;
  out["point_m"] = point_json(point);
  const std::optional<Index3> nearest = nearest_voxel(map, point);
  if (!nearest) {
    out["reason"] = "not a point of a map";
    return out;
  }
  const Index3 at = *nearest;
  const Block* block = map.store.get(block_of_voxel(at));
  const float weight = block == nullptr ? 0.0f : block->geometry->weight[offset_in_block(at)];
  out["voxel"] = {at.x, at.y, at.z};
  out["weight"] = weight;
  if (!(weight > 0)) {
    out["signed_distance_m"] = nullptr;
    out["reason"] = "never observed";
    return out;
  }
  const std::optional<double> between = sample_tsdf(map, point);
  out["signed_distance_m"] = between.value_or(double(block->geometry->tsdf[offset_in_block(at)]));
  out["interpolated"] = between.has_value();
  if (instances) out["instance"] = instance_json(*block, offset_in_block(at));
  voxel = at;
  return out;
}

/// What the properties of a belief are computed from: equal numbers, equal answer.
std::vector<double> forecast_of(const Belief& belief) {
  std::vector<double> numbers = belief.readings;
  for (const StudentTMixture& next : belief.next_reading) {
    numbers.push_back(double(next.weight.size()));
    for (size_t c = 0; c < next.weight.size(); ++c)
      numbers.insert(numbers.end(),
                     {next.weight[c], next.component[c].location, next.component[c].scale2, next.component[c].dof});
  }
  return numbers;
}

/// Answers in the order of the points. Quantiles take most of the time: each distinct forecast is asked for once, all
/// in parallel.
std::vector<json> answers(const Map& map, const std::vector<Eigen::Vector3d>& points, std::optional<double> below) {
  const bool instances = has_instances(map);
  Beliefs beliefs(map);
  std::vector<json> all;
  std::map<std::vector<double>, size_t> number;  // of a forecast
  std::vector<Belief> distinct;
  std::vector<std::optional<size_t>> forecast;
  for (const Eigen::Vector3d& point : points) {
    std::optional<Index3> voxel;
    json out = geometry_json(map, point, instances, voxel);
    forecast.emplace_back();
    if (voxel) {
      Belief belief = beliefs.at(*voxel);
      out.update(class_json(map, belief));
      const auto [at, is_new] = number.emplace(forecast_of(belief), distinct.size());
      forecast.back() = at->second;
      if (is_new) distinct.push_back(std::move(belief));
    }
    all.push_back(std::move(out));
  }
  std::vector<json> properties(distinct.size());
  tbb::parallel_for(size_t(0), distinct.size(),
                    [&](size_t i) { properties[i] = properties_json(map, distinct[i], below); });
  for (size_t i = 0; i < all.size(); ++i)
    if (forecast[i]) all[i]["properties"] = properties[*forecast[i]];
  return all;
}

int run_query(const QueryOptions& options) {
  Map map = load_map(options.map);
  use_properties(map, options.properties);
  std::vector<Eigen::Vector3d> points;
  for (const std::string& at : options.at) points.push_back(point_of(at));
  if (!options.file.empty())
    for (const Eigen::Vector3d& p : read_points(options.file)) points.push_back(p);
  const std::vector<json> all = answers(map, points, options.below);
  if (options.json) {
    print_json(json{{"points", all}});
    return kDone;
  }
  for (size_t i = 0; i < points.size(); ++i) {
    const json& a = all[i];
    std::printf("%s: ", point_text(points[i].x(), points[i].y(), points[i].z()).c_str());
    if (a.contains("reason")) {
      std::printf("%s\n", a["reason"].get<std::string>().c_str());
      continue;
    }
    std::printf("distance %.4f m%s, weight %g", a["signed_distance_m"].get<double>(),
                a["interpolated"].get<bool>() ? "" : " of the nearest voxel", a["weight"].get<double>());
    if (a.contains("class") && a["class"].is_null())
      std::printf(", class unknown: no label was seen there");
    else if (a.contains("class"))
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
  command.add_option("MAP", options->map, "Map file")->required();
  CLI::Option_group& where = *command.add_option_group("Where");
  where.require_option(1, 2);
  where.add_option("--at", options->at, "World point, metres: x,y,z; may be repeated")
      ->check(check_point)
      ->allow_extra_args(false);
  where.add_option("--file", options->file,
                   "Points (CSV): x,y,z a line, or a header line that names x, y and z among others");
  command.add_option("--properties", options->properties,
                     "Property table (YAML), instead of the one that the map may have");
  command.add_option("--below", options->below, "Probability that a property is at most this")->check(finite());
}

}  // namespace felt::apps
