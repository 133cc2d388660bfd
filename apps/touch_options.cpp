#include "apps/touch_options.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numeric>
#include <sstream>
#include <utility>

#include "apps/number_checks.h"
#include "apps/run_settings.h"
#include "core/error.h"
#include "inference/decision.h"
#include "io/readings/mask_image.h"
#include "io/tables/property_yaml.h"

namespace felt::apps {
namespace {

using json = nlohmann::ordered_json;

std::optional<std::vector<double>> numbers_of(const std::string& text) {
  std::vector<double> numbers;
  if (text.ends_with(',')) return std::nullopt;
  std::istringstream cells(text);
  for (std::string cell; std::getline(cells, cell, ',');) {
    try {
      size_t used = 0;
      numbers.push_back(std::stod(cell, &used));
      if (used != cell.size() || !std::isfinite(numbers.back())) return std::nullopt;
    } catch (const std::exception&) {
      return std::nullopt;
    }
  }
  return numbers;
}

/// Threshold of the gait decision of Ewen et al. 2024: below it the legged robot walks statically.
constexpr double kGaitFriction = 0.25;

json property_json(const StudentTMixture& next, const Property& property, double readings,
                   std::optional<double> below) {
  json out;
  out["unit"] = property.unit;
  out["touches"] = readings;
  if (next.weight.empty()) {
    out["mean"] = nullptr;
    out["reason"] = "no class with a prior";
    return out;
  }
  const auto value = [](const std::optional<double>& x) { return x ? json(*x) : json(nullptr); };
  const std::optional<double> m = mean(next), v = variance(next);
  out["mean"] = value(m);
  out["sd"] = v ? json(std::sqrt(*v)) : json(nullptr);
  out["location"] = location(next);
  if (!m)
    out["reason"] = "a class has at most one degree of freedom: no mean, sd or CVaR";
  else if (!v)
    out["reason"] = "a class has at most two degrees of freedom: no sd";
  for (const auto& [key, p] : {std::pair("0.05", 0.05), {"0.25", 0.25}, {"0.5", 0.5}, {"0.75", 0.75}, {"0.95", 0.95}})
    out["quantiles"][key] = value(quantile(next, p));
  out["cvar"] = {{"lower_0.05", value(cvar(next, 0.05, Tail::lower))},
                 {"upper_0.95", value(cvar(next, 0.95, Tail::upper))}};
  out["modes"] = modes(next);
  if (below) out["below"] = {{"threshold", *below}, {"probability", cdf(next, *below)}};
  if (property.name == "friction" && m)
    out["gait"] = {{"threshold", kGaitFriction}, {"decision", *m <= kGaitFriction ? "static" : "dynamic"}};
  return out;
}

}  // namespace

std::string check_point(const std::string& text) {
  const auto numbers = numbers_of(text);
  if (numbers && numbers->size() == 3) return "";
  return "expected x,y,z in metres, found '" + text + "'";
}

Eigen::Vector3d point_of(const std::string& text) {
  const auto numbers = numbers_of(text);
  return {numbers->at(0), numbers->at(1), numbers->at(2)};
}

std::vector<CLI::Option*> RegionOptions::add_to(CLI::App& command) {
  std::vector<CLI::Option*> added;
  const auto add = [&](const char* name, auto& value, const char* text) {
    return added.emplace_back(command.add_option(name, value, text));
  };
  add("--region", rule, "connected, mask, sphere, instance: the thing touched, or segment of the whole map")
      ->check(CLI::IsMember({"connected", "mask", "sphere", "instance", "segment"}))
      ->capture_default_str();
  add("--radius", settings.radius_m, "Limit in metres: along the surface, or of the sphere")->check(above_zero());
  add("--snap", settings.snap_voxels, "How far the surface may be from the point, voxels")
      ->check(within(0, 64))
      ->capture_default_str();
  add("--band", settings.band_voxels, "Half width of the surface band, voxels")
      ->check(above_zero_up_to(8))
      ->capture_default_str();
  min_weight = add("--min-weight", settings.min_weight,
                   "Observation weight of an observed voxel [1; any, where the weight of frames depends on depth]")
                   ->check(above_zero());
  add("--class-ratio", settings.class_ratio, "Least belief in the contact's class against the voxel's strongest")
      ->check(within(0, 1))
      ->capture_default_str();
  add("--normal-change", settings.normal_change_deg,
      "Largest angle between neighbours, degrees; noisy surfaces raise it, to 30 at most")
      ->check(above_zero_up_to(180))
      ->capture_default_str();
  add("--color-change", settings.color_change,
      "Largest difference from the contact's colour, grey levels; with --region segment between neighbours, CIE Lab")
      ->check(at_least_zero());
  add("--mask", mask, "Image whose non-zero pixels belong to the region (with --region mask)");
  add("--intrinsics", intrinsics, "Camera of the mask: fx,fy,cx,cy or fx,fy,cx,cy,width,height")
      ->delimiter(',')
      ->expected(4, 6)
      ->option_text("FLOAT x 4 or 6");
  add("--pose", pose, "Camera to world of the mask: 16 numbers row by row")->delimiter(',')->expected(16);
  return added;
}

RegionSettings RegionOptions::resolved(const Map& map) const {
  RegionSettings out = settings;
  if (min_weight->count() == 0) out.min_weight = least_observed_weight(map);
  out.rule = rule_of_name(rule);
  if (out.rule == RegionRule::sphere && !std::isfinite(out.radius_m))
    throw ConfigError("--region sphere: expected --radius, found none");
  validate(out);
  return out;
}

std::optional<ViewMask> RegionOptions::view() const {
  if (rule != "mask" && !(mask.empty() && intrinsics.empty() && pose.empty()))
    throw ConfigError(describe_mismatch("--mask, --intrinsics, --pose", "region", "--region mask", "--region " + rule));
  if (rule != "mask") return std::nullopt;
  if (mask.empty() || (intrinsics.size() != 4 && intrinsics.size() != 6) || pose.size() != 16)
    throw ConfigError("--region mask: expected --mask, --intrinsics and --pose, found not all of them");
  return read_view_mask(mask, intrinsics, pose);
}

json point_json(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

json class_json(const Map& map, const Belief& belief) {
  json out = json::object();
  if (map.classes.size() > 0) {
    out["class"] = map.classes.at_slot(most_probable_class(belief.class_probability)).name;
    for (int c = 0; c < map.classes.size(); ++c)
      out["class_probability"][map.classes.at_slot(c).name] = belief.class_probability[size_t(c)];
    out["class_entropy"] = class_entropy(belief.class_probability);
    const double all = std::accumulate(belief.concentration.begin(), belief.concentration.end(), 0.0);
    out["class_evidence"] = std::max(0.0, all - map.classes.prior_total());
  }
  return out;
}

json properties_json(const Map& map, const Belief& belief, std::optional<double> below) {
  json out = json::object();
  for (int p = 0; p < map.properties.size(); ++p)
    out[map.properties[p].name] =
        property_json(belief.next_reading[size_t(p)], map.properties[p], belief.readings[size_t(p)], below);
  return out;
}

json belief_json(const Map& map, const Belief& belief, std::optional<double> below) {
  json out = class_json(map, belief);
  out["properties"] = properties_json(map, belief, below);
  return out;
}

json summary_json(const Map& map, const RegionSummary& summary) {
  json out;
  out["voxels"] = summary.voxels;
  out["blocks"] = summary.blocks;
  out["area_m2"] = summary.area_m2;
  out["extent_m"] = {{"min", point_json(summary.min_m)}, {"max", point_json(summary.max_m)}};
  out["class_voxels"] = json::object();
  for (int c = 0; c < map.classes.size(); ++c)
    if (summary.class_voxels[size_t(c)] > 0)
      out["class_voxels"][map.classes.at_slot(c).name] = summary.class_voxels[size_t(c)];
  out["unlabelled_voxels"] = summary.unlabelled_voxels;
  out["leaks"] = {{"necks", summary.necks},
                  {"mixed_fraction", summary.mixed_fraction},
                  {"boundary_voxels", summary.boundary_voxels},
                  {"open_boundary_fraction", summary.open_boundary_fraction}};
  out["warnings"] = summary.warnings;
  return out;
}

std::string belief_text(const Map& map, const Belief& belief) {
  std::ostringstream out;
  out.precision(3);
  if (map.classes.size() > 0) {
    const int best = most_probable_class(belief.class_probability);
    out << map.classes.at_slot(best).name << " " << belief.class_probability[size_t(best)];
  }
  for (int p = 0; p < map.properties.size(); ++p) {
    const StudentTMixture& next = belief.next_reading[size_t(p)];
    out << ", " << map.properties[p].name << " ";
    const std::optional<double> m = next.weight.empty() ? std::nullopt : mean(next);
    if (!m) {
      out << "unknown";
      continue;
    }
    out << *m;
    if (const auto v = variance(next)) out << " +- " << std::sqrt(*v);
  }
  return out.str();
}

std::string property_text(const json& belief) {
  std::ostringstream out;
  out.precision(3);
  for (const auto& [name, p] : belief.at("properties").items()) {
    out << "  " << name << ": ";
    if (!p.contains("location")) {
      out << p.at("reason").get<std::string>() << "\n";
      continue;
    }
    const auto number = [&](const json& x) -> std::string {
      if (x.is_null()) return "?";
      std::ostringstream text;
      text.precision(3);
      text << x.get<double>();
      return text.str();
    };
    out << number(p.at("mean")) << " +- " << number(p.at("sd"))
        << ", 5 to 95 %: " << number(p.at("quantiles").at("0.05")) << " to " << number(p.at("quantiles").at("0.95"))
        << ", CVaR: " << number(p.at("cvar").at("lower_0.05")) << " and " << number(p.at("cvar").at("upper_0.95"));
    if (p.contains("below"))
      out << ", P(<= " << p.at("below").at("threshold").get<double>() << ") "
          << number(p.at("below").at("probability"));
    if (p.contains("gait")) out << ", " << p.at("gait").at("decision").get<std::string>() << " gait";
    if (p.contains("reason")) out << " (" << p.at("reason").get<std::string>() << ")";
    out << "\n";
  }
  return out.str();
}

void warn_of_misspelt_priors(const PropertyTable& properties, const ClassTable& classes, const std::string& where) {
  const auto same = [](const std::string& a, const std::string& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                      [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
  };
  for (const Property& property : properties.properties())
    for (const auto& [name, prior] : property.priors) {
      if (classes.slot_of_name(name)) continue;
      for (int c = 0; c < classes.size(); ++c)
        if (same(name, classes.at_slot(c).name))
          spdlog::warn("{}: prior of {} for '{}': not used, as the class is called '{}'", where, property.name, name,
                       classes.at_slot(c).name);
    }
}

void use_properties(Map& map, const std::string& file) {
  if (file.empty()) return;
  const PropertyTable table = read_properties(file);
  // The index of a property is its place in the statistics planes.
  for (int p = 0; p < map.properties.size(); ++p)
    if (!map.touches.touches.empty() && table.index_of(map.properties[p].name) != p)
      throw ConfigError(describe_mismatch(file, "properties", "those of the map, in their order, before new ones",
                                          "'" + map.properties[p].name + "' elsewhere or not at all"));
  warn_of_misspelt_priors(table, map.classes, file);
  map.properties = table;
}

}  // namespace felt::apps
