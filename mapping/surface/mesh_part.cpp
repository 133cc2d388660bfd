#include "mapping/surface/mesh_part.h"

#include <algorithm>
#include <cstddef>
#include <vector>

namespace felt {
namespace {

template <typename T>
std::vector<T> chosen(const std::vector<T>& all, const std::vector<uint32_t>& which) {
  std::vector<T> some;
  if (all.empty()) return some;
  some.reserve(which.size());
  for (const uint32_t i : which) some.push_back(all[i]);
  return some;
}

std::vector<MeshScalars> chosen(const std::vector<MeshScalars>& all, const std::vector<uint32_t>& which) {
  std::vector<MeshScalars> some;
  for (const MeshScalars& scalars : all) some.push_back({scalars.name, chosen(scalars.values, which)});
  return some;
}

void copy_vertices(const TriangleMesh& from, const std::vector<uint32_t>& which, TriangleMesh& to) {
  to.positions = chosen(from.positions, which);
  to.normals = chosen(from.normals, which);
  to.colors = chosen(from.colors, which);
  to.labels = chosen(from.labels, which);
  to.scalars = chosen(from.scalars, which);
}

}  // namespace

TriangleMesh part_of(const TriangleMesh& mesh, const std::function<bool(const Triangle&)>& keep) {
  constexpr uint32_t kUnused = 0xffffffff;
  std::vector<uint32_t> number(mesh.positions.size(), kUnused), vertices, triangles;
  TriangleMesh part;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& triangle = mesh.triangles[t];
    if (!keep(triangle)) continue;
    Triangle renumbered;
    for (int corner = 0; corner < 3; ++corner) {
      uint32_t& n = number[triangle[corner]];
      if (n == kUnused) {
        n = uint32_t(vertices.size());
        vertices.push_back(triangle[corner]);
      }
      renumbered[corner] = n;
    }
    part.triangles.push_back(renumbered);
    triangles.push_back(uint32_t(t));
  }
  copy_vertices(mesh, vertices, part);
  part.triangle_scalars = chosen(mesh.triangle_scalars, triangles);
  return part;
}

TriangleMesh points_of(const TriangleMesh& mesh, const std::function<bool(uint32_t)>& keep) {
  std::vector<uint32_t> vertices;
  for (uint32_t i = 0; i < mesh.positions.size(); ++i)
    if (keep(i)) vertices.push_back(i);
  TriangleMesh points;
  copy_vertices(mesh, vertices, points);
  return points;
}

}  // namespace felt
