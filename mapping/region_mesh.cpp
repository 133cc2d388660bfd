#include "mapping/region_mesh.h"

#include <vector>

#include "mapping/marching_cubes.h"

namespace felt {

TriangleMesh region_mesh(const Map& map, const Region& region) {
  std::vector<VertexEdge> edges;
  const TriangleMesh whole = extract_mesh(map, {}, &edges);
  const auto inside = [&](uint32_t vertex) {
    VertexEdge e = edges[vertex];
    if (e.t >= 0.5f) (e.axis == 0 ? e.voxel.x : e.axis == 1 ? e.voxel.y : e.voxel.z) += 1;
    return region.contains(e.voxel);
  };
  constexpr uint32_t kUnused = 0xffffffff;
  std::vector<uint32_t> number(whole.positions.size(), kUnused);
  TriangleMesh part;
  for (const Triangle& triangle : whole.triangles) {
    if (inside(triangle[0]) + inside(triangle[1]) + inside(triangle[2]) < 2) continue;
    Triangle renumbered;
    for (int i = 0; i < 3; ++i) {
      uint32_t& n = number[triangle[i]];
      if (n == kUnused) {
        n = uint32_t(part.positions.size());
        part.positions.push_back(whole.positions[triangle[i]]);
        if (!whole.normals.empty()) part.normals.push_back(whole.normals[triangle[i]]);
        if (!whole.colors.empty()) part.colors.push_back(whole.colors[triangle[i]]);
      }
      renumbered[i] = n;
    }
    part.triangles.push_back(renumbered);
  }
  return part;
}

}  // namespace felt
