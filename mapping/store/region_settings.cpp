#include "mapping/store/region_settings.h"

#include <cmath>

#include "core/text.h"

namespace felt {

const char* rule_name(RegionRule rule) {
  switch (rule) {
    case RegionRule::connected:
      return "connected";
    case RegionRule::mask:
      return "mask";
    case RegionRule::sphere:
      return "sphere";
    case RegionRule::instance:
      return "instance";
    case RegionRule::segment:
      return "segment";
  }
  return "";
}

RegionRule rule_of_name(const std::string& name) {
  for (const RegionRule rule :
       {RegionRule::connected, RegionRule::mask, RegionRule::sphere, RegionRule::instance, RegionRule::segment})
    if (name == rule_name(rule)) return rule;
  throw TouchError(
      describe_mismatch("region", "rule", "connected, mask, sphere, instance or segment", "'" + name + "'"));
}

void validate(const RegionSettings& s) {
  std::string problems;
  const auto expect = [&](bool good, const char* what, const char* expected, double found) {
    if (good) return;
    problems.append(problems.empty() ? "" : "\n");
    problems.append(describe_mismatch("region", what, expected, number_text(found)));
  };
  expect(s.band_voxels > 0 && s.band_voxels <= 8, "band_voxels", "0 < band <= 8", s.band_voxels);
  expect(s.min_weight > 0 && std::isfinite(s.min_weight), "min_weight", "a positive number", s.min_weight);
  expect(s.snap_voxels >= 0 && s.snap_voxels <= 64, "snap_voxels", "0 to 64", s.snap_voxels);
  expect(s.class_ratio >= 0 && s.class_ratio <= 1, "class_ratio", "0 to 1", s.class_ratio);
  expect(s.normal_change_deg > 0 && s.normal_change_deg <= 180, "normal_change_deg", "0 < angle <= 180",
         s.normal_change_deg);
  expect(s.color_change >= 0, "color_change", "0 or more", s.color_change);
  expect(s.radius_m > 0, "radius_m", "a positive number", s.radius_m);
  if (s.rule == RegionRule::sphere) expect(std::isfinite(s.radius_m), "radius_m", "a finite radius", s.radius_m);
  if (!problems.empty()) throw TouchError(problems);
}

}  // namespace felt
