#include "mapping/regions/region_query.h"

#include <tbb/parallel_for.h>
#include <cstdio>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "core/text.h"
#include "mapping/regions/map_segments.h"
#include "mapping/regions/region_flood.h"
#include "mapping/regions/region_surface.h"

namespace felt {
namespace {

std::string metres(double x) { return number_text(x, "%.3f m"); }

SurfaceRule band_rule(const Map& map, const RegionSettings& settings) {
  SurfaceRule rule;
  rule.band_m = float(settings.band_voxels * map.voxel_size_m);
  rule.min_weight = float(settings.min_weight);
  rule.voxel_m = float(map.voxel_size_m);
  return rule;
}

Region surface_blocks(const Map& map, const SurfaceRule& rule) {
  const std::vector<uint32_t> order = map.store.sorted();
  std::vector<BlockMask> masks(order.size());
  tbb::parallel_for(size_t(0), order.size(), [&](size_t n) { masks[n] = candidates(map.store[order[n]], rule); });
  Region region;
  for (size_t n = 0; n < order.size(); ++n)
    if (masks[n].any()) region.append(map.store[order[n]].coord, masks[n]);
  return region;
}

void limit_color(const Map& map, const Index3& voxel, double change, SurfaceRule& rule) {
  const Block& block = *map.store.get(block_of_voxel(voxel));
  const int i = offset_in_block(voxel);
  if (block.color == nullptr || block.color->count[i] == 0)
    throw TouchError("region: colour limit: expected a coloured contact, found none there");
  rule.limit_color = true;
  rule.color[0] = block.color->r[i] / 256.0f;
  rule.color[1] = block.color->g[i] / 256.0f;
  rule.color[2] = block.color->b[i] / 256.0f;
  rule.color_change = float(change);
}

bool map_has_labels(const Map& map) {
  return std::any_of(map.store.blocks().begin(), map.store.blocks().end(),
                     [](const Block& b) { return !b.evidence.empty(); });
}

/// Calls `visit(block, offset)` for the voxels of the surface band within two voxels of the contact.
template <typename Visit>
void for_each_near(const Map& map, const Index3& centre, const SurfaceRule& band, const Visit& visit) {
  for (int dx = -2; dx <= 2; ++dx)
    for (int dy = -2; dy <= 2; ++dy)
      for (int dz = -2; dz <= 2; ++dz) {
        const Index3 v{centre.x + dx, centre.y + dy, centre.z + dz};
        const Block* block = map.store.get(block_of_voxel(v));
        const int i = offset_in_block(v);
        if (block != nullptr && block->geometry->weight[i] >= band.min_weight &&
            std::abs(block->geometry->tsdf[i]) <= band.band_m)
          visit(*block, i);
      }
}

/// Strongest class there, -1 where there is no evidence.
int contact_class(const Map& map, const Index3& centre, const SurfaceRule& band) {
  std::vector<double> sum(size_t(std::max(1, map.classes.size())), 0.0);
  for_each_near(map, centre, band, [&](const Block& block, int i) {
    for (const EvidencePlane& e : block.evidence)
      if (e.slot < sum.size()) sum[e.slot] += e.counts->value[i];
  });
  const auto best = std::max_element(sum.begin(), sum.end());
  return *best > 0 ? int(best - sum.begin()) : -1;
}

/// The thing that most of these voxels belong to, the lowest id of equals. Throws TouchError where there is none.
uint16_t contact_instance(const Map& map, const Index3& centre, const SurfaceRule& band) {
  std::map<uint16_t, int> voxels;
  for_each_near(map, centre, band, [&](const Block& block, int i) {
    if (block.instance != nullptr && block.instance->votes[i] > 0) ++voxels[block.instance->id[i]];
  });
  voxels.erase(0);
  const auto most =
      std::max_element(voxels.begin(), voxels.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most != voxels.end()) return most->first;
  const bool any = std::any_of(map.store.blocks().begin(), map.store.blocks().end(),
                               [](const Block& b) { return b.instance != nullptr; });
  throw TouchError(describe_mismatch("region instance", "contact",
                                     any ? "a surface that belongs to a thing" : "a map with instance ids",
                                     any ? "one without an instance id" : "none (reconstruct --instances)"));
}

/// The contact's segment of the map, cut to `within`.
Region segment_around(const Map& map, const Contact& contact, const RegionSettings& settings, const Region& within) {
  for (const Region& segment : map_segments(map, map_segment_settings(settings)))
    if (segment.contains(contact.voxel)) return intersected(segment, within);
  throw TouchError("region segment: contact: expected a surface that is part of a segment, found a piece too small");
}

/// Says what is at a point, one that a map has, that is too far from every surface.
[[noreturn]] void fail_to_snap(const Map& map, const Eigen::Vector3d& p, const std::string& where, double radius_m,
                               double min_weight) {
  const std::string expected = "observed surface within " + metres(radius_m);
  const Index3 v = *nearest_voxel(map, p);
  const Block* block = map.store.get(block_of_voxel(v));
  if (block != nullptr && block->geometry->weight[offset_in_block(v)] > 0) {
    const double d = block->geometry->tsdf[offset_in_block(v)];
    if (std::abs(d) <= map.voxel_size_m && double(block->geometry->weight[offset_in_block(v)]) < min_weight) {
      char weights[64];
      snprintf(weights, sizeof weights, "surface of weight %.3g, least %.3g",
               double(block->geometry->weight[offset_in_block(v)]), min_weight);
      throw TouchError(describe_mismatch(where, "contact", expected, weights));
    }
    throw TouchError(describe_mismatch(where, "contact", expected,
                                       d > 0 ? "free space (signed distance " + metres(d) + ")"
                                             : "the inside of something (signed distance " + metres(d) + ")"));
  }
  Eigen::Array3d lo = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity()), hi = -lo;
  for (const Block& b : map.store.blocks()) {
    const Eigen::Array3d first(b.coord.x * 8.0, b.coord.y * 8.0, b.coord.z * 8.0);
    lo = lo.min(first - 0.5);
    hi = hi.max(first + 7.5);
  }
  const Eigen::Array3d q = p / map.voxel_size_m;
  const bool outside = map.store.empty() || (q < lo).any() || (q > hi).any();
  throw TouchError(
      describe_mismatch(where, "contact", expected, outside ? "a point outside the map" : "unobserved space"));
}

}  // namespace

Contact find_contact(const Map& map, const Eigen::Vector3d& point_m, const RegionSettings& settings) {
  const std::string point = point_text(point_m.x(), point_m.y(), point_m.z()), where = "point " + point;
  if (!nearest_voxel(map, point_m))
    throw TouchError(describe_mismatch(where, "contact", "three finite coordinates inside the map", point));
  const SurfaceRule band = band_rule(map, settings);
  const Eigen::Vector3d q = point_m / map.voxel_size_m;
  const double radius = settings.snap_voxels;
  const auto lo = [&](double x) { return int32_t(std::ceil(x - radius)); };
  const auto hi = [&](double x) { return int32_t(std::floor(x + radius)); };
  Contact contact;
  contact.point_m = point_m;
  // Distance to the surface through a voxel's centre: the nearest zero crossing, not the nearest band voxel.
  double best = std::numeric_limits<double>::infinity();
  for (int32_t x = lo(q.x()); x <= hi(q.x()); ++x)
    for (int32_t y = lo(q.y()); y <= hi(q.y()); ++y)
      for (int32_t z = lo(q.z()); z <= hi(q.z()); ++z) {
        const Block* block = map.store.get(block_of_voxel({x, y, z}));
        const int i = offset_in_block({x, y, z});
        if (block == nullptr || block->geometry->weight[i] < band.min_weight) continue;
        const double tsdf = std::abs(double(block->geometry->tsdf[i]));
        const Eigen::Vector3d centre(x, y, z);
        const double from_point = (centre - q).norm();
        if (tsdf > band.band_m || from_point > radius) continue;
        const double cost = from_point * from_point + tsdf * tsdf / (map.voxel_size_m * map.voxel_size_m);
        if (cost >= best) continue;
        best = cost;
        contact.voxel = {x, y, z};
      }
  if (!std::isfinite(best)) fail_to_snap(map, point_m, where, radius * map.voxel_size_m, settings.min_weight);
  contact.normal = surface_normal(map, contact.voxel, band.min_weight).cast<double>();
  const Block& block = *map.store.get(block_of_voxel(contact.voxel));
  contact.surface_m = Eigen::Vector3d(contact.voxel.x, contact.voxel.y, contact.voxel.z) * map.voxel_size_m -
                      double(block.geometry->tsdf[offset_in_block(contact.voxel)]) * contact.normal;
  contact.distance_m = (contact.surface_m - point_m).norm();
  contact.slot = contact_class(map, contact.voxel, band);
  if (contact.slot < 0 && map_has_labels(map))
    throw TouchError(describe_mismatch(where, "contact", "a surface with a class",
                                       "one without labels (an ignored class, or never labelled)"));
  return contact;
}

FittedNormal surrounding_normal(const Map& map, const Contact& contact, const RegionSettings& settings) {
  return fitted_normal(map, contact.voxel, contact.normal, band_rule(map, settings));
}

double normal_limit_deg(const Map& map, const Contact& contact, const RegionSettings& settings) {
  constexpr double kNoises = 3, kMostDeg = 30;
  if (settings.normal_change_deg >= kMostDeg) return settings.normal_change_deg;
  const double noise_deg = normal_noise_deg(map, contact.voxel, band_rule(map, settings));
  return std::max(settings.normal_change_deg, std::min(kNoises * noise_deg, kMostDeg));
}

Region find_region(const Map& map, const Contact& contact, const RegionSettings& settings) {
  validate(settings);
  SurfaceRule rule = band_rule(map, settings);
  rule.centre = contact.voxel;
  rule.radius_voxels = float(settings.radius_m / map.voxel_size_m);
  if (settings.rule == RegionRule::sphere) return surface_blocks(map, rule);
  if (settings.rule == RegionRule::instance) {
    rule.instance = contact_instance(map, contact.voxel, rule);
    return surface_blocks(map, rule);
  }
  if (settings.rule == RegionRule::segment) return segment_around(map, contact, settings, surface_blocks(map, rule));
  if (settings.rule != RegionRule::connected)
    throw TouchError(
        describe_mismatch("region", "rule", "connected, sphere, instance or segment", rule_name(settings.rule)));
  rule.slot = contact.slot;
  rule.class_ratio = float(settings.class_ratio);
  for (int c = 0; c < map.classes.size(); ++c) rule.prior.push_back(float(map.classes.prior(c)));
  rule.cos_normal_change = float(std::cos(normal_limit_deg(map, contact, settings) * std::numbers::pi / 180));
  if (std::isfinite(settings.color_change)) limit_color(map, contact.voxel, settings.color_change, rule);
  Region region = flood_region(map, rule, contact.voxel);
  if (region.empty())
    throw TouchError(
        "region: contact: expected a voxel that agrees with its own surroundings, found class noise there");
  if (std::isfinite(settings.radius_m) && region.contains(contact.voxel))
    region = within_geodesic(region, contact.voxel, settings.radius_m / map.voxel_size_m);
  return region;
}

Region find_region(const Map& map, const ViewMask& view, const RegionSettings& settings, const Contact* contact) {
  validate(settings);
  if (view.mask.width() != view.camera.width || view.mask.height() != view.camera.height)
    throw TouchError(describe_mismatch("region mask", "size", size_text(view.camera.width, view.camera.height),
                                       size_text(view.mask.width(), view.mask.height())));
  const Region surface = surface_blocks(map, band_rule(map, settings));
  const Eigen::Isometry3d T_camera_world = view.T_world_camera.inverse();
  const double vs = map.voxel_size_m;
  const auto in_camera = [&](const BlockCoord& c, int i) -> Eigen::Vector3d {
    const Index3 v = voxel_at(c, i);
    return T_camera_world * (Eigen::Vector3d(v.x, v.y, v.z) * vs);
  };
  const auto for_each_voxel = [&](const auto& visit) {
    for (size_t b = 0; b < surface.blocks(); ++b)
      for_each_bit(surface.mask[b], [&](int i) {
        const Eigen::Vector3d p = in_camera(surface.coord[b], i);
        if (p.z() > vs) visit(b, i, p, view.camera.project(p));
      });
  };
  // Depth of the nearest surface voxel by pixel; a voxel covers every pixel that its width subtends.
  DepthImage nearest(view.camera.width, view.camera.height, std::numeric_limits<float>::infinity());
  for_each_voxel([&](size_t, int, const Eigen::Vector3d& p, const Eigen::Vector2d& uv) {
    const double ru = 0.5 * view.camera.fx * vs / p.z(), rv = 0.5 * view.camera.fy * vs / p.z();
    const auto clamp = [](double x, int n) { return int(std::clamp(x, 0.0, double(n))); };
    const int u1 = clamp(std::floor(uv.x() + ru) + 1, nearest.width()),
              v1 = clamp(std::floor(uv.y() + rv) + 1, nearest.height());
    for (int v = clamp(std::ceil(uv.y() - rv), nearest.height()); v < v1; ++v)
      for (int u = clamp(std::ceil(uv.x() - ru), nearest.width()); u < u1; ++u)
        nearest(u, v) = std::min(nearest(u, v), float(p.z()));
  });
  std::vector<BlockMask> kept(surface.blocks());
  for_each_voxel([&](size_t b, int i, const Eigen::Vector3d& p, const Eigen::Vector2d& uv) {
    const double u = std::floor(uv.x() + 0.5), v = std::floor(uv.y() + 0.5);
    if (u < 0 || v < 0 || u >= nearest.width() || v >= nearest.height()) return;
    if (view.mask(int(u), int(v)) != 0 && p.z() <= double(nearest(int(u), int(v))) + 2 * vs) kept[b].set(i);
  });
  Region region;
  for (size_t b = 0; b < surface.blocks(); ++b)
    if (kept[b].any()) region.append(surface.coord[b], kept[b]);
  if (region.empty()) throw TouchError("region mask: expected pixels that see the map, found none");
  if (contact != nullptr && !region.contains(contact->voxel))
    throw TouchError("region mask: expected the contact inside the mask, found it outside");
  if (contact != nullptr && std::isfinite(settings.radius_m))
    region = within_geodesic(region, contact->voxel, settings.radius_m / vs);
  return region;
}

}  // namespace felt
