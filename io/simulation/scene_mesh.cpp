#include "io/simulation/scene_mesh.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string>

#include "io/atomic_file.h"

namespace felt {
namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

/// A smooth piece of a solid's surface over the parameters (u, v) in [0, 1]^2, in the shape's frame.
struct Patch {
  enum Kind : uint8_t { flat, sphere, cylinder_side, disc } kind = flat;
  Vector3d origin = Vector3d::Zero(), along_u = Vector3d::Zero(), along_v = Vector3d::Zero();  // flat
  double radius_m = 0, half_height_m = 0;                                                      // the others
  double side = 1;  // disc: +1 the upper, -1 the lower cap
  int pieces_u = 1, pieces_v = 1;

  Vector3d point(double u, double v) const {
    switch (kind) {
      case flat:
        return origin + u * along_u + v * along_v;
      case sphere: {
        const double longitude = 2 * kPi * u, latitude = kPi * (v - 0.5);
        return radius_m * Vector3d(std::cos(latitude) * std::cos(longitude), std::cos(latitude) * std::sin(longitude),
                                   std::sin(latitude));
      }
      case cylinder_side:
        return {radius_m * std::cos(2 * kPi * u), radius_m * std::sin(2 * kPi * u), half_height_m * (2 * v - 1)};
      case disc: {
        const double r = radius_m * (1 - v), angle = side * 2 * kPi * u;
        return {r * std::cos(angle), r * std::sin(angle), side * half_height_m};
      }
    }
    return origin;
  }
};

int pieces_of_circle(double radius_m, double chord_error_m) {
  return std::max(12, int(std::ceil(kPi / std::acos(1 - std::min(0.5, chord_error_m / radius_m)))));
}

std::vector<Patch> patches_of(const Primitive& p, double chord_error_m) {
  const Vector3d& half = p.half_size_m;
  std::vector<Patch> patches;
  switch (p.shape) {
    case ShapeKind::plane:
      patches.push_back({Patch::flat, {-half.x(), -half.y(), 0}, {2 * half.x(), 0, 0}, {0, 2 * half.y(), 0}});
      break;
    case ShapeKind::box:
      for (int axis = 0; axis < 3; ++axis)
        for (const double side : {-1.0, 1.0}) {
          // u cross v points outward on both sides.
          const int a = side > 0 ? (axis + 1) % 3 : (axis + 2) % 3, b = side > 0 ? (axis + 2) % 3 : (axis + 1) % 3;
          Patch face;
          face.origin =
              side * half[axis] * Vector3d::Unit(axis) - half[a] * Vector3d::Unit(a) - half[b] * Vector3d::Unit(b);
          face.along_u = 2 * half[a] * Vector3d::Unit(a);
          face.along_v = 2 * half[b] * Vector3d::Unit(b);
          patches.push_back(face);
        }
      break;
    case ShapeKind::sphere: {
      const int n = pieces_of_circle(half.x(), chord_error_m);
      Patch ball;
      ball.kind = Patch::sphere, ball.radius_m = half.x(), ball.pieces_u = n, ball.pieces_v = (n + 1) / 2;
      patches.push_back(ball);
      break;
    }
    case ShapeKind::cylinder: {
      Patch part;
      part.kind = Patch::cylinder_side, part.radius_m = half.x(), part.half_height_m = half.z();
      part.pieces_u = pieces_of_circle(half.x(), chord_error_m);
      patches.push_back(part);
      part.kind = Patch::disc;
      for (const double side : {-1.0, 1.0}) part.side = side, patches.push_back(part);
      break;
    }
  }
  return patches;
}

/// Cuts patches into quadrilaterals that are visible as a whole.
class Tessellator {
public:
  Tessellator(const Scene& scene, int own, const SceneMeshOptions& options, SceneMesh& mesh)
      : scene_(scene), primitive_(scene.primitives[own]), options_(options), mesh_(mesh) {
    for (size_t i = 0; i < scene.primitives.size(); ++i)
      if (int(i) != own) others_.push_back(int(i));
  }

  void add(const Patch& patch) {
    for (int j = 0; j < patch.pieces_v; ++j)
      for (int i = 0; i < patch.pieces_u; ++i)
        cut(patch, double(i) / patch.pieces_u, double(i + 1) / patch.pieces_u, double(j) / patch.pieces_v,
            double(j + 1) / patch.pieces_v);
  }

private:
  Vector3d world(const Patch& patch, double u, double v) const { return primitive_.T_world_shape * patch.point(u, v); }

  void cut(const Patch& patch, double u0, double u1, double v0, double v1) {
    const Vector3d corners[4] = {world(patch, u0, v0), world(patch, u1, v0), world(patch, u1, v1),
                                 world(patch, u0, v1)};
    const Vector3d middle = world(patch, (u0 + u1) / 2, (v0 + v1) / 2);
    double radius_m = 0;
    Eigen::AlignedBox3d extent(middle);
    for (const Vector3d& corner : corners) {
      radius_m = std::max(radius_m, (corner - middle).norm());
      extent.extend(corner);
    }
    // Outside of the bounds: nobody looks there. Faces of the bounds themselves belong to the scene.
    constexpr double kSlack_m = 1e-9;
    const Eigen::AlignedBox3d bounds(scene_.bounds.min() - Vector3d::Constant(kSlack_m),
                                     scene_.bounds.max() + Vector3d::Constant(kSlack_m));
    if (!bounds.intersects(extent)) return;
    const double cover_m = distance_to_others(middle);
    if (cover_m < -radius_m) return;
    const bool whole = cover_m >= radius_m && bounds.contains(extent);
    const double du = std::max((corners[1] - corners[0]).norm(), (corners[2] - corners[3]).norm());
    const double dv = std::max((corners[3] - corners[0]).norm(), (corners[2] - corners[1]).norm());
    if (whole || std::max(du, dv) <= options_.border_size_m) {
      // A point in the plane of another solid's face is covered by that face.
      if (whole || (cover_m > kSlack_m && bounds.contains(middle))) emit(corners);
      return;
    }
    if (du >= dv) {
      cut(patch, u0, (u0 + u1) / 2, v0, v1);
      cut(patch, (u0 + u1) / 2, u1, v0, v1);
    } else {
      cut(patch, u0, u1, v0, (v0 + v1) / 2);
      cut(patch, u0, u1, (v0 + v1) / 2, v1);
    }
  }

  double distance_to_others(const Vector3d& p) const {
    double nearest_m = HUGE_VAL;
    for (const int i : others_) nearest_m = std::min(nearest_m, signed_distance_m(scene_.primitives[i], p));
    return nearest_m;
  }

  void emit(const Vector3d* corners) {
    const uint32_t first = uint32_t(mesh_.vertices.size());
    for (int i = 0; i < 4; ++i) mesh_.vertices.push_back(corners[i].cast<float>());
    for (const auto& [a, b, c] : {std::array<uint32_t, 3>{0, 1, 2}, {0, 2, 3}}) {
      // At the poles of a sphere and the middle of a disc two corners are one.
      const bool flat = (corners[b] - corners[a]).cross(corners[c] - corners[a]).norm() < 1e-14;
      if (flat) continue;
      mesh_.triangles.push_back({first + a, first + b, first + c});
      mesh_.semantic.push_back(primitive_.semantic);
      mesh_.material.push_back(primitive_.material);
      mesh_.instance.push_back(primitive_.instance);
    }
  }

  const Scene& scene_;
  const Primitive& primitive_;
  const SceneMeshOptions& options_;
  SceneMesh& mesh_;
  std::vector<int> others_;
};

}  // namespace

SceneMesh scene_mesh(const Scene& scene, const SceneMeshOptions& options) {
  std::vector<SceneMesh> parts(scene.primitives.size());
  tbb::parallel_for(size_t(0), parts.size(), [&](size_t i) {
    Tessellator tessellator(scene, int(i), options, parts[i]);
    for (const Patch& patch : patches_of(scene.primitives[i], options.chord_error_m)) tessellator.add(patch);
  });
  SceneMesh mesh;
  for (const SceneMesh& part : parts) {
    const uint32_t first = uint32_t(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), part.vertices.begin(), part.vertices.end());
    for (const auto& t : part.triangles) mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    mesh.semantic.insert(mesh.semantic.end(), part.semantic.begin(), part.semantic.end());
    mesh.material.insert(mesh.material.end(), part.material.begin(), part.material.end());
    mesh.instance.insert(mesh.instance.end(), part.instance.begin(), part.instance.end());
  }
  return mesh;
}

void write_scene_mesh(const SceneMesh& mesh, const std::filesystem::path& file) {
  static_assert(std::endian::native == std::endian::little, "the PLY is written in the machine's byte order");
  std::string ply =
      "ply\nformat binary_little_endian 1.0\ncomment exact surface of a simulated scene, metres\nelement vertex " +
      std::to_string(mesh.vertices.size()) + "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
      std::to_string(mesh.triangles.size()) +
      "\nproperty list uchar int vertex_indices\nproperty uchar semantic\nproperty uchar material\n"
      "property ushort instance\nend_header\n";
  const auto append = [&](const auto& value) { ply.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (const Eigen::Vector3f& v : mesh.vertices)
    for (int i = 0; i < 3; ++i) append(v[i]);
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    append(uint8_t(3));
    for (const uint32_t vertex : mesh.triangles[i]) append(int32_t(vertex));
    append(uint8_t(mesh.semantic[i]));
    append(uint8_t(mesh.material[i]));
    append(mesh.instance[i]);
  }
  write_file_atomically(file, ply);
}

}  // namespace felt
