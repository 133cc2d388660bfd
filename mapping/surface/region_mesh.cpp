#include "mapping/surface/region_mesh.h"

#include <vector>

#include "mapping/surface/marching_cubes.h"
#include "mapping/surface/mesh_part.h"
#include "mapping/surface/surface_color.h"

namespace felt {

TriangleMesh region_mesh(const Map& map, const Region& region) {
  std::vector<VertexEdge> edges;
  TriangleMesh whole = extract_mesh(map, {}, &edges);
  attach_beliefs(map, edges, whole);
  const auto inside = [&](uint32_t vertex) { return region.contains(nearest_voxel(edges[vertex])); };
  return part_of(whole, [&](const Triangle& t) { return inside(t[0]) + inside(t[1]) + inside(t[2]) >= 2; });
}

}  // namespace felt
