#include "apps/options/touch_options.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <sstream>

#include "apps/options/number_checks.h"
#include "apps/options/run_settings.h"
#include "core/error.h"
#include "core/pose.h"
#include "io/readings/mask_image.h"
#include "io/tables/property_yaml.h"

namespace felt::apps {
namespace {

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

}  // namespace

std::string check_point(const std::string& text) {
  const auto numbers = numbers_of(text);
  if (numbers && numbers->size() == 3) return "";
  return "expected x,y,z in metres, found '" + text + "'";
}

std::string check_direction(const std::string& text) {
  const auto numbers = numbers_of(text);
  if (numbers && numbers->size() == 3 && Eigen::Vector3d(numbers->data()).stableNorm() > 0) return "";
  return "expected a direction x,y,z, found '" + text + "'";
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
      ->allow_extra_args(false)
      ->option_text("FLOAT x 4 or 6");
  add("--pose", pose, "Camera to world of the mask: 16 numbers row by row")
      ->delimiter(',')
      ->expected(16)
      ->allow_extra_args(false);
  return added;
}

RegionSettings RegionOptions::resolved(const Map& map) const {
  RegionSettings out = settings;
  if (min_weight->count() == 0) out.min_weight = least_observed_weight(map);
  out.rule = rule_of_name(rule);
  if (out.rule == RegionRule::sphere && !std::isfinite(out.radius_m))
    throw CLI::ValidationError(describe_mismatch("--region sphere", "limit", "--radius", "none"));
  if (pose.size() == 16) {
    const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> recorded(pose.data());
    if (Eigen::Isometry3d T_world_camera; rigid_pose(recorded, T_world_camera) != PoseFault::none)
      throw CLI::ValidationError(describe_mismatch("--pose", "matrix", "a rigid transform", "another"));
  }
  validate(out);
  return out;
}

std::optional<ViewMask> RegionOptions::view() const {
  if (rule != "mask" && !(mask.empty() && intrinsics.empty() && pose.empty()))
    throw CLI::ValidationError(
        describe_mismatch("--mask, --intrinsics, --pose", "region", "--region mask", "--region " + rule));
  if (rule != "mask") return std::nullopt;
  if (intrinsics.size() == 5)
    throw CLI::ValidationError(describe_mismatch("--intrinsics", "camera of the mask", "4 or 6 numbers", "5"));
  if (mask.empty() || (intrinsics.size() != 4 && intrinsics.size() != 6) || pose.size() != 16)
    throw CLI::ValidationError(
        describe_mismatch("--region mask", "view", "--mask, --intrinsics and --pose", "not all of them"));
  return read_view_mask(mask, intrinsics, pose);
}

Region RegionOptions::region_at(const Map& map, const Contact& contact, const RegionSettings& of_map) const {
  const std::optional<ViewMask> seen = view();
  return seen ? find_region(map, *seen, of_map, &contact) : find_region(map, contact, of_map);
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
