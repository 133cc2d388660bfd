#include "io/simulation/scene_mesh.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <string>

#include "io/files/atomic_file.h"
#include "io/simulation/convex_clip.h"

namespace felt {
namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

int pieces_of_circle(double radius_m, double chord_error_m) {
  return std::max(12, int(std::ceil(kPi / std::acos(1 - std::min(0.5, chord_error_m / radius_m)))));
}

Vector3d on_circle(double radius_m, int i, int n, double z) {
  const double angle = 2 * kPi * (i % n) / n;
  return {radius_m * std::cos(angle), radius_m * std::sin(angle), z};
}

std::vector<Polygon> box_faces(const Vector3d& half) {
  std::vector<Polygon> faces;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      // The first edge cross the second points outward on both sides.
      const int first = side > 0 ? (axis + 1) % 3 : (axis + 2) % 3, second = 3 - axis - first;
      const Vector3d middle = side * half[axis] * Vector3d::Unit(axis), a = half[first] * Vector3d::Unit(first),
                     b = half[second] * Vector3d::Unit(second);
      faces.push_back({middle - a - b, middle + a - b, middle + a + b, middle - a + b});
    }
  }
  return faces;
}

std::vector<Polygon> sphere_faces(double radius_m, int n) {
  // Rings of latitude; at the poles two corners are one.
  const int rings = (n + 1) / 2;
  const auto corner = [&](int i, int ring) {
    const double latitude = kPi * (double(ring) / rings - 0.5);
    return on_circle(radius_m * std::cos(latitude), i, n, radius_m * std::sin(latitude));
  };
  std::vector<Polygon> faces;
  for (int ring = 0; ring < rings; ++ring) {
    for (int i = 0; i < n; ++i) {
      Polygon face = {corner(i, ring)};
      if (ring > 0) face.push_back(corner(i + 1, ring));
      face.push_back(corner(i + 1, ring + 1));
      if (ring + 1 < rings) face.push_back(corner(i, ring + 1));
      faces.push_back(std::move(face));
    }
  }
  return faces;
}

std::vector<Polygon> cylinder_faces(double radius_m, double half_height_m, int n) {
  std::vector<Polygon> faces(2);
  for (int i = 0; i < n; ++i) {
    const Vector3d low = on_circle(radius_m, i, n, -half_height_m), high = on_circle(radius_m, i, n, half_height_m);
    const Vector3d next_low = on_circle(radius_m, i + 1, n, -half_height_m),
                   next_high = on_circle(radius_m, i + 1, n, half_height_m);
    faces.push_back({low, next_low, next_high, high});
    faces[0].push_back(on_circle(radius_m, n - i, n, -half_height_m));
    faces[1].push_back(high);
  }
  return faces;
}

/// Faces of a solid in the world frame, counter-clockwise from outside.
std::vector<Polygon> faces_of(const Primitive& p, double chord_error_m) {
  const Vector3d& half = p.half_size_m;
  std::vector<Polygon> faces;
  switch (p.shape) {
    case ShapeKind::plane:
      faces = {
          {{-half.x(), -half.y(), 0}, {half.x(), -half.y(), 0}, {half.x(), half.y(), 0}, {-half.x(), half.y(), 0}}};
      break;
    case ShapeKind::box:
      faces = box_faces(half);
      break;
    case ShapeKind::sphere:  // curved both ways, so each has half of the error
      faces = sphere_faces(half.x(), pieces_of_circle(half.x(), chord_error_m / 2));
      break;
    case ShapeKind::cylinder:
      faces = cylinder_faces(half.x(), half.z(), pieces_of_circle(half.x(), chord_error_m));
      break;
  }
  for (Polygon& face : faces)
    for (Vector3d& corner : face) corner = p.T_world_shape * corner;
  return faces;
}

Vector3d normal_of(const Polygon& face) {
  Vector3d normal = Vector3d::Zero();
  for (size_t i = 2; i < face.size(); ++i) normal += (face[i - 1] - face[0]).cross(face[i] - face[0]);
  return normal.normalized();
}

/// The solid as half-spaces, as far as it meets the plane of a face: a sphere is cut there along a circle, which
/// becomes a prism. Empty: it does not meet the plane.
std::vector<HalfSpace> half_spaces(const Primitive& p, const Polygon& face, double chord_error_m) {
  const Eigen::Matrix3d& R = p.T_world_shape.linear();
  const Vector3d at = p.T_world_shape.translation(), &half = p.half_size_m;
  std::vector<HalfSpace> all;
  const auto add = [&](const Vector3d& normal, double distance_m) {
    all.push_back({normal, normal.dot(at) + distance_m});
  };
  switch (p.shape) {
    case ShapeKind::plane:
      add(R.col(2), 0);
      break;
    case ShapeKind::box:
      for (int axis = 0; axis < 3; ++axis) add(R.col(axis), half[axis]), add(-R.col(axis), half[axis]);
      break;
    case ShapeKind::sphere: {
      const Vector3d normal = normal_of(face);
      const double off_m = normal.dot(face[0] - at), squared = half.x() * half.x() - off_m * off_m;
      if (squared <= 1e-12) break;
      const int n = pieces_of_circle(std::sqrt(squared), chord_error_m);
      const Vector3d u = normal.unitOrthogonal(), v = normal.cross(u);
      for (int i = 0; i < n; ++i) {
        const double angle = 2 * kPi * (i + 0.5) / n;
        add(std::cos(angle) * u + std::sin(angle) * v, std::sqrt(squared) * std::cos(kPi / n));
      }
      break;
    }
    case ShapeKind::cylinder: {
      const int n = pieces_of_circle(half.x(), chord_error_m);
      for (int i = 0; i < n; ++i) {
        const double angle = 2 * kPi * (i + 0.5) / n;
        add(R * Vector3d(std::cos(angle), std::sin(angle), 0), half.x() * std::cos(kPi / n));
      }
      add(R.col(2), half.z()), add(-R.col(2), half.z());
      break;
    }
  }
  return all;
}

/// The face lies in a face of the other solid and looks the same way.
bool shares_face(const Polygon& face, const std::vector<HalfSpace>& other) {
  const Vector3d normal = normal_of(face);
  return std::any_of(other.begin(), other.end(), [&](const HalfSpace& h) {
    return h.normal.dot(normal) > 1 - 1e-9 && std::abs(h.signed_distance(face[0])) <= 1e-7;
  });
}

std::vector<Polygon> visible_parts(const Scene& scene, size_t own, const Polygon& face, double chord_error_m) {
  Polygon within = face;
  for (int axis = 0; axis < 3 && !within.empty(); ++axis) {
    within = clipped(within, {Vector3d::Unit(axis), scene.bounds.max()[axis]});
    within = clipped(within, {-Vector3d::Unit(axis), -scene.bounds.min()[axis]});
  }
  if (within.empty()) return {};
  Eigen::AlignedBox3d extent;
  for (const Vector3d& corner : within) extent.extend(corner);
  const double radius_m = extent.diagonal().norm() / 2;
  std::vector<Polygon> parts = {within};
  for (size_t i = 0; i < scene.primitives.size(); ++i) {
    if (i == own || signed_distance_m(scene.primitives[i], extent.center()) > radius_m + chord_error_m) continue;
    const std::vector<HalfSpace> other = half_spaces(scene.primitives[i], within, chord_error_m);
    if (other.empty() || (i > own && shares_face(within, other))) continue;
    std::vector<Polygon> left;
    for (const Polygon& part : parts)
      for (Polygon& piece : subtracted(part, other)) left.push_back(std::move(piece));
    parts = std::move(left);
  }
  return parts;
}

TriangleMesh visible_surface(const Scene& scene, size_t own, double chord_error_m) {
  TriangleMesh mesh;
  for (const Polygon& face : faces_of(scene.primitives[own], chord_error_m)) {
    for (const Polygon& part : visible_parts(scene, own, face, chord_error_m)) {
      const uint32_t first = uint32_t(mesh.positions.size());
      for (const Vector3d& corner : part) mesh.positions.push_back(corner.cast<float>());
      for (uint32_t i = 2; i < part.size(); ++i) mesh.triangles.emplace_back(first, first + i - 1, first + i);
    }
  }
  return mesh;
}

}  // namespace

TriangleMesh scene_mesh(const Scene& scene, double chord_error_m) {
  std::vector<TriangleMesh> parts(scene.primitives.size());
  tbb::parallel_for(size_t(0), parts.size(), [&](size_t i) { parts[i] = visible_surface(scene, i, chord_error_m); });
  TriangleMesh mesh;
  mesh.triangle_scalars = {{"semantic", {}}, {"material", {}}, {"instance", {}}};
  for (size_t i = 0; i < parts.size(); ++i) {
    const uint32_t first = uint32_t(mesh.positions.size());
    mesh.positions.insert(mesh.positions.end(), parts[i].positions.begin(), parts[i].positions.end());
    for (const Triangle& t : parts[i].triangles) mesh.triangles.emplace_back(t.array() + first);
    const Primitive& p = scene.primitives[i];
    const uint16_t ids[] = {p.semantic, p.material, p.instance};
    for (size_t s = 0; s < std::size(ids); ++s)
      mesh.triangle_scalars[s].values.resize(mesh.triangles.size(), float(ids[s]));
  }
  return mesh;
}

void write_scene_mesh(const TriangleMesh& mesh, const std::filesystem::path& file) {
  static_assert(std::endian::native == std::endian::little, "the PLY is written in the machine's byte order");
  std::string ply =
      "ply\nformat binary_little_endian 1.0\ncomment exact surface of a simulated scene, metres\nelement vertex " +
      std::to_string(mesh.positions.size()) + "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
      std::to_string(mesh.triangles.size()) +
      "\nproperty list uchar int vertex_indices\nproperty uchar semantic\nproperty uchar material\n"
      "property ushort instance\nend_header\n";
  const auto append = [&](const auto& value) { ply.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (const Eigen::Vector3f& v : mesh.positions)
    for (int i = 0; i < 3; ++i) append(v[i]);
  const auto scalar = [&](const char* name, size_t i) {
    return TriangleMesh::find(mesh.triangle_scalars, name)->at(i);
  };
  for (size_t i = 0; i < mesh.triangles.size(); ++i) {
    append(uint8_t(3));
    for (const uint32_t vertex : mesh.triangles[i]) append(int32_t(vertex));
    append(uint8_t(scalar("semantic", i)));
    append(uint8_t(scalar("material", i)));
    append(uint16_t(scalar("instance", i)));
  }
  write_file_atomically(file, ply);
}

}  // namespace felt
