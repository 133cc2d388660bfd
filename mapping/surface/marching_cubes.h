#pragma once

#include <cstdint>
#include <vector>

#include "core/mesh.h"
#include "mapping/map.h"

namespace felt {

struct MeshOptions {
  float min_weight = 1e-6f;  ///< a voxel counts as observed from this weight on
  bool normals = true;
  bool colors = true;  ///< where the map has any
};

/// Where a vertex lies between two voxels, for sampling whatever else the map stores: at voxel + t * e_axis.
struct VertexEdge {
  Index3 voxel;      ///< the lower of the two
  uint8_t axis = 0;  ///< 0: x, 1: y, 2: z
  float t = 0;       ///< in (0, 1)
  bool operator==(const VertexEdge&) const = default;
};

/// The zero level of the signed distance as a mesh with shared vertices (Lorensen and Cline 1987). Only cells whose
/// eight corners were observed give triangles: the mesh ends where observation ends, and is watertight and
/// consistently oriented elsewhere. Normals follow the gradient of the signed distance (central differences, one-sided
/// at the limit of what was observed), colours are interpolated. Vertices keep 1/1024 voxel away from voxel centres,
/// so that no triangle degenerates where a stored distance is exactly zero.
///
/// Parallel over blocks; the result is the same for any number of threads: blocks in canonical order, within a block
/// edges by axis and voxel offset, triangles by cell offset. With `edges`, also where each vertex was found.
TriangleMesh extract_mesh(const Map& map, const MeshOptions& options = {}, std::vector<VertexEdge>* edges = nullptr);

}  // namespace felt
