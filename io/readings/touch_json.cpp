#include "io/readings/touch_json.h"

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/text.h"
#include "io/files/json_number.h"

namespace felt {
namespace {

using json = nlohmann::ordered_json;

// JSON has no infinity and no NaN: null stands for what a setting's default leaves open.
json finite(double x) { return std::isfinite(x) ? json(x) : json(nullptr); }
double number(const json& j, double if_null) { return j.is_null() ? if_null : j.get<double>(); }
constexpr double kInf = std::numeric_limits<double>::infinity(), kNan = std::numeric_limits<double>::quiet_NaN();

json to_json(const BeliefSummary& s) {
  return {{"class_probability", s.class_probability},
          {"class_entropy", s.class_entropy},
          {"mean", finite(s.mean)},
          {"sd", finite(s.sd)}};
}

BeliefSummary summary_from(const json& j) {
  return {j.at("class_probability").get<std::vector<double>>(), j.at("class_entropy").get<double>(),
          number(j.at("mean"), kNan), number(j.at("sd"), kNan)};
}

json to_json(const RegionSettings& s) {
  return {{"rule", rule_name(s.rule)},
          {"band_voxels", s.band_voxels},
          {"min_weight", s.min_weight},
          {"snap_voxels", s.snap_voxels},
          {"class_ratio", s.class_ratio},
          {"normal_change_deg", s.normal_change_deg},
          {"color_change", finite(s.color_change)},
          {"radius_m", finite(s.radius_m)}};
}

RegionSettings settings_from(const json& j) {
  RegionSettings s;
  s.rule = rule_of_name(j.at("rule").get<std::string>());
  s.band_voxels = j.at("band_voxels").get<double>();
  s.min_weight = j.at("min_weight").get<double>();
  s.snap_voxels = j.at("snap_voxels").get<double>();
  s.class_ratio = j.at("class_ratio").get<double>();
  s.normal_change_deg = j.at("normal_change_deg").get<double>();
  s.color_change = number(j.at("color_change"), kInf);
  s.radius_m = number(j.at("radius_m"), kInf);
  validate(s);
  return s;
}

json point(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }
Eigen::Vector3d point_from(const json& j) {
  return {j.at(0).get<double>(), j.at(1).get<double>(), j.at(2).get<double>()};
}

json to_json(const Touch& t) {
  const TouchRequest& r = t.request;
  json out = {{"id", id_text(t.id)},
              {"stamp_s", r.stamp_s},
              {"point_m", point(r.point_m)},
              {"property", r.property},
              {"value", r.value},
              {"sigma", r.sigma},
              {"model", model_name(r.model)},
              {"projection", projection_name(r.projection)},
              {"rho", finite(r.rho)},
              {"region", to_json(r.region)},
              {"voxel", {t.voxel.x, t.voxel.y, t.voxel.z}},
              {"surface_m", point(t.surface_m)},
              {"undone", t.undone},
              {"before", to_json(t.before)},
              {"after", to_json(t.after)},
              {"refused_voxels", t.refused_voxels}};
  if (r.view != 0) out["view"] = hexadecimal(r.view);
  return out;
}

Touch touch_from(const json& j) {
  Touch t;
  t.id = id_of_text(j.at("id").get<std::string>());
  t.request.stamp_s = j.at("stamp_s").get<double>();
  t.request.point_m = point_from(j.at("point_m"));
  t.request.property = j.at("property").get<std::string>();
  t.request.value = j.at("value").get<double>();
  t.request.sigma = j.at("sigma").get<double>();
  t.request.model = model_of_name(j.at("model").get<std::string>());
  t.request.projection = projection_of_name(j.at("projection").get<std::string>());
  t.request.rho = number(j.at("rho"), kNan);
  t.request.region = settings_from(j.at("region"));
  if (j.contains("view")) t.request.view = id_of_text(j.at("view").get<std::string>());
  t.voxel = {whole_number<int32_t>(j.at("voxel").at(0)), whole_number<int32_t>(j.at("voxel").at(1)),
             whole_number<int32_t>(j.at("voxel").at(2))};
  t.surface_m = point_from(j.at("surface_m"));
  t.undone = j.at("undone").get<bool>();
  t.before = summary_from(j.at("before"));
  t.after = summary_from(j.at("after"));
  t.refused_voxels = whole_number<uint64_t>(j.at("refused_voxels"));
  return t;
}

}  // namespace

std::string touch_journal_json(const TouchJournal& journal) {
  json all = json::array();
  for (const Touch& touch : journal.touches) all.push_back(to_json(touch));
  return all.dump();
}

TouchJournal parse_touch_journal(const std::string& text, const std::string& where) {
  TouchJournal journal;
  try {
    for (const json& row : json::parse(text)) journal.touches.push_back(touch_from(row));
  } catch (const std::exception& error) {
    throw FormatError(
        describe_mismatch(where, "touch journal", "the JSON that docs/file_format.md describes", error.what()));
  }
  return journal;
}

}  // namespace felt
