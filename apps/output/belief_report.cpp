#include "apps/output/belief_report.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>
#include <utility>

#include "inference/decision.h"

namespace felt::apps {
namespace {

using json = nlohmann::ordered_json;

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

json point_json(const Eigen::Vector3d& p) { return {p.x(), p.y(), p.z()}; }

json class_json(const Map& map, const Belief& belief) {
  json out = json::object();
  if (map.classes.size() > 0) {
    const double all = std::accumulate(belief.concentration.begin(), belief.concentration.end(), 0.0);
    const double evidence = std::max(0.0, all - map.classes.prior_total());
    // Where nothing was seen or felt, the most probable class is just the first one.
    const bool informed =
        evidence > 0 || std::any_of(belief.readings.begin(), belief.readings.end(), [](double n) { return n > 0; });
    out["class"] = nullptr;
    if (informed) out["class"] = map.classes.at_slot(most_probable_class(belief.class_probability)).name;
    for (int c = 0; c < map.classes.size(); ++c)
      out["class_probability"][map.classes.at_slot(c).name] = belief.class_probability[size_t(c)];
    out["class_entropy"] = class_entropy(belief.class_probability);
    out["class_evidence"] = evidence;
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

}  // namespace felt::apps
