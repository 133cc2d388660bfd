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
  part.positions = chosen(mesh.positions, vertices);
  part.normals = chosen(mesh.normals, vertices);
  part.colors = chosen(mesh.colors, vertices);
  part.labels = chosen(mesh.labels, vertices);
  part.scalars = chosen(mesh.scalars, vertices);
  part.triangle_scalars = chosen(mesh.triangle_scalars, triangles);
  return part;
}

}  // namespace felt
