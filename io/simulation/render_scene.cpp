#include "io/simulation/render_scene.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "io/simulation/random.h"
#include "io/simulation/texture.h"

namespace felt {
namespace {

using Eigen::Vector3d;

constexpr int kTile = 16;              // pixels: a tile tests only the solids whose image rectangle it meets
constexpr double kOcclusion_m = 0.12;  // contact shading: clearance in front of a point below which it gets less light

struct ShapeHit {
  double t = HUGE_VAL;
  Vector3d normal = Vector3d::Zero();  // shape frame
};

/// First crossing from outside at t > 0 of a ray o + t d in the shape's frame; t infinite where it misses.
ShapeHit cast_at_shape(ShapeKind shape, const Vector3d& half, const Vector3d& o, const Vector3d& d) {
  ShapeHit hit;
  switch (shape) {
    case ShapeKind::plane:
      if (d.z() < 0 && o.z() > 0) hit = {-o.z() / d.z(), Vector3d::UnitZ()};
      break;
    case ShapeKind::box: {
      double near = -HUGE_VAL, far = HUGE_VAL;
      int axis = 0;
      for (int i = 0; i < 3; ++i) {
        // A ray inside a face's plane gives 0 * inf = NaN, which the comparisons below pass over.
        const double inverse = 1 / d[i], a = (-half[i] - o[i]) * inverse, b = (half[i] - o[i]) * inverse;
        const double enter = std::min(a, b);
        if (enter > near) near = enter, axis = i;
        far = std::min(far, std::max(a, b));
      }
      if (near > 0 && near <= far) {
        hit.t = near;
        hit.normal[axis] = d[axis] < 0 ? 1 : -1;
      }
      break;
    }
    case ShapeKind::sphere: {
      const double a = d.squaredNorm(), b = o.dot(d), c = o.squaredNorm() - half.x() * half.x(), disc = b * b - a * c;
      if (c > 0 && b < 0 && disc >= 0) {
        hit.t = c / (-b + std::sqrt(disc));  // the stable form of (-b - sqrt) / a
        hit.normal = (o + hit.t * d).normalized();
      }
      break;
    }
    case ShapeKind::cylinder: {
      const double r = half.x(), h = half.z();
      const double cap = d.z() < 0 ? h : -h, t_cap = (cap - o.z()) / d.z();
      if (t_cap > 0 && t_cap < HUGE_VAL) {
        const double x = o.x() + t_cap * d.x(), y = o.y() + t_cap * d.y();
        if (x * x + y * y <= r * r && std::abs(o.z()) > h) return {t_cap, Vector3d(0, 0, cap > 0 ? 1 : -1)};
      }
      const double a = d.x() * d.x() + d.y() * d.y(), b = o.x() * d.x() + o.y() * d.y();
      const double c = o.x() * o.x() + o.y() * o.y() - r * r, disc = b * b - a * c;
      if (c > 0 && b < 0 && disc >= 0) {
        const double t = c / (-b + std::sqrt(disc)), z = o.z() + t * d.z();
        if (std::abs(z) <= h) hit = {t, Vector3d((o.x() + t * d.x()) / r, (o.y() + t * d.y()) / r, 0)};
      }
      break;
    }
  }
  return hit;
}

/// A solid as one camera sees it.
struct SeenPrimitive {
  int index;
  Eigen::Matrix3d R_shape_camera;
  Vector3d origin;        // camera centre, shape frame
  double nearest_m;       // no point of it has a smaller depth
  Eigen::Array4i rect;    // u0, v0, u1, v1 (inclusive) of its image, conservative
  Eigen::Array4i around;  // same of the solid grown by the reach of contact shading
};

/// Image rectangle of an oriented box grown by `margin_m`; everything where it reaches behind the camera; empty where
/// it is behind altogether.
Eigen::Array4i image_rect(const PinholeCamera& camera, const Eigen::Isometry3d& T_camera_shape, const Vector3d& half,
                          double margin_m, double& nearest_m) {
  const Eigen::Array4i all{0, 0, camera.width - 1, camera.height - 1}, none{0, 0, -1, -1};
  double u0 = HUGE_VAL, v0 = HUGE_VAL, u1 = -HUGE_VAL, v1 = -HUGE_VAL, z0 = HUGE_VAL, z1 = -HUGE_VAL;
  for (int corner = 0; corner < 8; ++corner) {
    const Vector3d sign((corner & 1) != 0 ? 1 : -1, (corner & 2) != 0 ? 1 : -1, (corner & 4) != 0 ? 1 : -1);
    const Vector3d p = T_camera_shape * Vector3d(sign.array() * (half.array() + margin_m));
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
    SeenPrimitive s{int(i), T_shape_camera.linear(), T_shape_camera.translation(), 0, {}, {}};
    if (p.shape == ShapeKind::plane) {
      s.rect = s.around = {0, 0, camera.width - 1, camera.height - 1};
    } else {
      Vector3d half = p.half_size_m;
      if (p.shape == ShapeKind::sphere) half = Vector3d::Constant(half.x());
      if (p.shape == ShapeKind::cylinder) half.y() = half.x();
      double nearest_grown_m = 0;
      s.around = image_rect(camera, T_shape_camera.inverse(), half, 2 * kOcclusion_m, nearest_grown_m);
      s.rect = image_rect(camera, T_shape_camera.inverse(), half, 0, s.nearest_m);
      if (s.around[2] < 0) continue;
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
float open_sky(const Scene& scene, const std::vector<const SeenPrimitive*>& around, const Vector3d& p_world,
               const Vector3d& normal, int own) {
  const Vector3d probe = p_world + kOcclusion_m * normal;
  double nearest_m = kOcclusion_m;
  for (const SeenPrimitive* s : around)
    if (s->index != own) nearest_m = std::min(nearest_m, signed_distance_m(scene.primitives[s->index], probe));
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
  const int tiles_x = (w + kTile - 1) / kTile, tiles_y = (h + kTile - 1) / kTile;

  const auto render_tile = [&](int tile) {
    const int u0 = tile % tiles_x * kTile, v0 = tile / tiles_x * kTile;
    const int u1 = std::min(u0 + kTile, w) - 1, v1 = std::min(v0 + kTile, h) - 1;
    std::vector<const SeenPrimitive*> candidates, around;
    for (const SeenPrimitive& s : seen) {
      if (s.rect[2] >= 0 && meets(s.rect, u0, v0, u1, v1)) candidates.push_back(&s);
      if (with_color && meets(s.around, u0, v0, u1, v1)) around.push_back(&s);
    }
    for (int v = v0; v <= v1; ++v) {
      for (int u = u0; u <= u1; ++u) {
        const Vector3d ray = camera.ray(u, v);
        ShapeHit best;
        const SeenPrimitive* hit_by = nullptr;
        for (const SeenPrimitive* s : candidates) {
          if (s->nearest_m > best.t) break;
          const Primitive& p = scene.primitives[s->index];
          const ShapeHit hit = cast_at_shape(p.shape, p.half_size_m, s->origin, s->R_shape_camera * ray);
          // Coplanar faces: the solid that comes first in the scene wins, whatever the order of the candidates.
          if (hit.t < best.t || (hit.t == best.t && hit_by != nullptr && s->index < hit_by->index))
            best = hit, hit_by = s;
        }
        if (hit_by == nullptr) continue;
        const Primitive& p = scene.primitives[hit_by->index];
        const size_t pixel = size_t(v) * w + u;
        view.depth_m.data()[pixel] = float(best.t);
        view.semantics.data()[pixel] = p.semantic;
        view.materials.data()[pixel] = p.material;
        view.instances.data()[pixel] = p.instance;
        const Vector3d normal_camera = hit_by->R_shape_camera.transpose() * best.normal;
        view.incidence_cos.data()[pixel] = float(std::abs(normal_camera.dot(ray)) / ray.norm());
        if (with_color) {
          const Vector3d p_world = T_world_camera * Vector3d(best.t * ray),
                         normal = T_world_camera.linear() * normal_camera;
          view.color.data()[pixel] =
              shade(scene, p, p_world, normal, open_sky(scene, around, p_world, normal, hit_by->index));
        }
      }
    }
  };
  tbb::parallel_for(tbb::blocked_range<int>(0, tiles_x * tiles_y), [&](const tbb::blocked_range<int>& range) {
    for (int tile = range.begin(); tile != range.end(); ++tile) render_tile(tile);
  });
  return view;
}

}  // namespace felt
