#include "io/simulation/render_scene.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "io/simulation/random.h"
#include "io/simulation/shape_cast.h"
#include "io/simulation/texture.h"

namespace felt {
namespace {

using Eigen::Vector3d;

// Pixels: a tile tests only the solids whose image rectangle it meets.
constexpr int kTile = RaySpan::kWidth;
// Contact shading: clearance in front of a point below which it gets less light.
constexpr double kOcclusion_m = 0.12;

/// A solid as one camera sees it.
struct SeenPrimitive {
  int index;
  Eigen::Matrix3d R_shape_camera;
  Vector3d origin;      // camera centre, shape frame
  double nearest_m;     // no point of it has a smaller depth
  Eigen::Array4i rect;  // u0, v0, u1, v1 (inclusive) of its image, conservative
};

/// Image rectangle of an oriented box: everything where it reaches behind the camera, u1 < u0 where it is out of view.
Eigen::Array4i image_rect(const PinholeCamera& camera, const Eigen::Isometry3d& T_camera_shape, const Vector3d& half,
                          double& nearest_m) {
  const Eigen::Array4i all{0, 0, camera.width - 1, camera.height - 1}, none{0, 0, -1, -1};
  double u0 = HUGE_VAL, v0 = HUGE_VAL, u1 = -HUGE_VAL, v1 = -HUGE_VAL, z0 = HUGE_VAL, z1 = -HUGE_VAL;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d sign((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
    const Vector3d p = T_camera_shape * Vector3d(sign.array() * half.array());
    z0 = std::min(z0, p.z()), z1 = std::max(z1, p.z());
    if (p.z() <= 1e-3) continue;
    const Eigen::Vector2d uv = camera.project(p);
    u0 = std::min(u0, uv.x()), u1 = std::max(u1, uv.x()), v0 = std::min(v0, uv.y()), v1 = std::max(v1, uv.y());
  }
  nearest_m = std::max(z0, 0.0);
  if (z1 <= 0) return none;
  if (z0 <= 1e-3) return all;
  const double w = camera.width - 1, h = camera.height - 1;
  if (u1 < 0 || v1 < 0 || u0 > w || v0 > h) return none;
  return {int(std::max(u0 - 1, 0.0)), int(std::max(v0 - 1, 0.0)), int(std::min(u1 + 1, w)), int(std::min(v1 + 1, h))};
}

std::vector<SeenPrimitive> seen_primitives(const Scene& scene, const PinholeCamera& camera,
                                           const Eigen::Isometry3d& T_world_camera) {
  std::vector<SeenPrimitive> seen;
  for (size_t i = 0; i < scene.primitives.size(); ++i) {
    const Primitive& p = scene.primitives[i];
    const Eigen::Isometry3d T_shape_camera = p.T_world_shape.inverse() * T_world_camera;
    SeenPrimitive s{int(i), T_shape_camera.linear(), T_shape_camera.translation(), 0, {}};
    if (p.shape == ShapeKind::plane) {
      s.rect = {0, 0, camera.width - 1, camera.height - 1};
    } else {
      Vector3d half = p.half_size_m;
      if (p.shape == ShapeKind::sphere) half = Vector3d::Constant(half.x());
      if (p.shape == ShapeKind::cylinder) half.y() = half.x();
      s.rect = image_rect(camera, T_shape_camera.inverse(), half, s.nearest_m);
      if (s.rect[2] < 0) continue;
    }
    seen.push_back(s);
  }
  // Front to back, so that a pixel can stop at the first solid that begins behind what it has hit.
  std::stable_sort(seen.begin(), seen.end(),
                   [](const SeenPrimitive& a, const SeenPrimitive& b) { return a.nearest_m < b.nearest_m; });
  return seen;
}

bool meets(const Eigen::Array4i& rect, int u0, int v0, int u1, int v1) {
  return rect[0] <= u1 && rect[2] >= u0 && rect[1] <= v1 && rect[3] >= v0;
}

/// Share of ambient light that reaches a point, from how close the nearest other solid is in front of it.
float open_sky(const Scene& scene, const std::vector<int>& around, const Vector3d& p_world, const Vector3d& normal,
               int own) {
  const Vector3d probe = p_world + kOcclusion_m * normal;
  double nearest_m = kOcclusion_m;
  for (const int i : around)
    if (i != own) nearest_m = std::min(nearest_m, signed_distance_m(scene.primitives[i], probe));
  const float open = float(std::max(nearest_m, 0.0) / kOcclusion_m);
  return 0.55f + 0.45f * open;
}

Rgba8 shade(const Scene& scene, const Primitive& primitive, const Vector3d& p_world, const Vector3d& normal,
            float sky) {
  const Eigen::Isometry3d& T = primitive.T_world_shape;
  const Vector3d p_shape = T.linear().transpose() * (p_world - T.translation());
  const Vector3d n_shape = T.linear().transpose() * normal;
  const Eigen::Vector3f albedo = texture_color(primitive.texture, p_shape, n_shape, mix64(primitive.instance));
  // One lamp (Lambert, fading with distance), light from above, and a little from one side so that walls differ.
  const Vector3d to_light = scene.light_m - p_world;
  const double distance_m = to_light.norm();
  const float lamp =
      float(std::max(0.0, normal.dot(to_light)) / distance_m * 2.2 / (1.0 + 0.22 * distance_m * distance_m));
  const float fill = float(0.42 + 0.13 * normal.z() + 0.06 * normal.x() - 0.04 * normal.y());
  const Eigen::Vector3f lit = albedo * (sky * (fill + 0.62f * lamp));
  return {srgb_byte(lit.x()), srgb_byte(lit.y()), srgb_byte(lit.z()), 255};
}

/// What a tile's pixels hit.
struct Tile {
  int u0, v0, u1, v1;  // inclusive
  RaySpan rows[kTile];
};

void cast_tile(const Scene& scene, const PinholeCamera& camera, const std::vector<SeenPrimitive>& seen, Tile& tile) {
  std::vector<const SeenPrimitive*> candidates;
  for (const SeenPrimitive& s : seen)
    if (meets(s.rect, tile.u0, tile.v0, tile.u1, tile.v1)) candidates.push_back(&s);
  double x[kTile];
  for (int i = 0; i < kTile; ++i) x[i] = camera.ray(tile.u0 + i, 0).x();
  for (int v = tile.v0; v <= tile.v1; ++v) {
    RaySpan& span = tile.rows[v - tile.v0];
    span.y = camera.ray(0, v).y();
    std::copy(x, x + kTile, span.x);
    std::fill(span.t, span.t + kTile, HUGE_VAL);
    std::fill(span.nearest, span.nearest + kTile, -1);
    double farthest_m = HUGE_VAL;  // no hit of the span is farther; renewed now and then
    for (size_t i = 0; i < candidates.size(); ++i) {
      const SeenPrimitive& s = *candidates[i];
      if (i % 4 == 3) farthest_m = *std::max_element(span.t, span.t + kTile);
      if (s.nearest_m > farthest_m) break;
      cast_span_at_shape(scene.primitives[s.index], s.R_shape_camera, s.origin, s.index, span);
    }
  }
}

/// Calls `visit(u, v, primitive, depth, ray)` for every pixel of the tile that hit something.
template <typename Visit>
void for_each_hit(const Tile& tile, const Visit& visit) {
  for (int v = tile.v0; v <= tile.v1; ++v) {
    const RaySpan& span = tile.rows[v - tile.v0];
    for (int u = tile.u0; u <= tile.u1; ++u) {
      const int i = u - tile.u0;
      if (span.nearest[i] >= 0) visit(u, v, span.nearest[i], span.t[i], Vector3d(span.x[i], span.y, 1));
    }
  }
}

/// The solids that contact shading of the tile's pixels can meet.
std::vector<int> solids_around(const Scene& scene, const Tile& tile, const Eigen::Isometry3d& T_world_camera) {
  Eigen::AlignedBox3d hits;
  for_each_hit(tile, [&](int, int, int, double depth_m, const Vector3d& ray) {
    hits.extend(T_world_camera * Vector3d(depth_m * ray));
  });
  std::vector<int> around;
  if (hits.isEmpty()) return around;
  const double reach_m = hits.diagonal().norm() / 2 + 2 * kOcclusion_m;
  for (size_t i = 0; i < scene.primitives.size(); ++i)
    if (signed_distance_m(scene.primitives[i], hits.center()) < reach_m) around.push_back(int(i));
  return around;
}

}  // namespace

SceneHit cast_ray(const Scene& scene, const Vector3d& origin_m, const Vector3d& direction) {
  SceneHit best;
  double nearest = HUGE_VAL;
  for (size_t i = 0; i < scene.primitives.size(); ++i) {
    const Primitive& p = scene.primitives[i];
    const Eigen::Matrix3d R = p.T_world_shape.linear();
    const ShapeHit hit = cast_at_shape(
        p.shape, p.half_size_m, R.transpose() * (origin_m - p.T_world_shape.translation()), R.transpose() * direction);
    if (hit.t < nearest) {
      nearest = hit.t;
      best = {hit.t, int(i), R * hit.normal};
    }
  }
  return best;
}

SceneView render_view(const Scene& scene, const PinholeCamera& camera, const Eigen::Isometry3d& T_world_camera,
                      bool with_color) {
  const int w = camera.width, h = camera.height;
  SceneView view{DepthImage(w, h), Image<float>(w, h), ColorImage(),
                 LabelImage(w, h), LabelImage(w, h),   LabelImage(w, h)};
  if (with_color) view.color = ColorImage(w, h, Rgba8{0, 0, 0, 255});
  const std::vector<SeenPrimitive> seen = seen_primitives(scene, camera, T_world_camera);
  std::vector<int> place_in_seen(scene.primitives.size(), -1);
  for (size_t i = 0; i < seen.size(); ++i) place_in_seen[seen[i].index] = int(i);
  const int tiles_x = (w + kTile - 1) / kTile, tiles_y = (h + kTile - 1) / kTile;

  const auto render_tile = [&](int number) {
    Tile tile;
    tile.u0 = number % tiles_x * kTile, tile.v0 = number / tiles_x * kTile;
    tile.u1 = std::min(tile.u0 + kTile, w) - 1, tile.v1 = std::min(tile.v0 + kTile, h) - 1;
    cast_tile(scene, camera, seen, tile);
    const std::vector<int> around = with_color ? solids_around(scene, tile, T_world_camera) : std::vector<int>();
    for_each_hit(tile, [&](int u, int v, int hit_by, double depth_m, const Vector3d& ray) {
      const Primitive& p = scene.primitives[hit_by];
      const SeenPrimitive& s = seen[place_in_seen[hit_by]];
      const Vector3d normal_shape = cast_at_shape(p.shape, p.half_size_m, s.origin, s.R_shape_camera * ray).normal;
      const Vector3d normal_camera = s.R_shape_camera.transpose() * normal_shape;
      const size_t pixel = size_t(v) * w + u;
      view.depth_m.data()[pixel] = float(depth_m);
      view.semantics.data()[pixel] = p.semantic;
      view.materials.data()[pixel] = p.material;
      view.instances.data()[pixel] = p.instance;
      view.incidence_cos.data()[pixel] = float(std::abs(normal_camera.dot(ray)) / ray.norm());
      if (!with_color) return;
      const Vector3d p_world = T_world_camera * Vector3d(depth_m * ray),
                     normal = T_world_camera.linear() * normal_camera;
      view.color.data()[pixel] = shade(scene, p, p_world, normal, open_sky(scene, around, p_world, normal, hit_by));
    });
  };
  tbb::parallel_for(tbb::blocked_range<int>(0, tiles_x * tiles_y), [&](const tbb::blocked_range<int>& range) {
    for (int tile = range.begin(); tile != range.end(); ++tile) render_tile(tile);
  });
  return view;
}

}  // namespace felt
