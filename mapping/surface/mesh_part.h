#pragma once

#include <functional>

#include "core/mesh.h"

namespace felt {

/// The triangles for which `keep` holds, in their order, with everything that the mesh knows of them and of the
/// vertices that they use; vertices are numbered anew in the order in which the triangles name them.
TriangleMesh part_of(const TriangleMesh& mesh, const std::function<bool(const Triangle&)>& keep);

/// The vertices for which `keep` holds, by their numbers, in their order, with everything that the mesh knows of them
/// and without triangles.
TriangleMesh points_of(const TriangleMesh& mesh, const std::function<bool(uint32_t)>& keep);

}  // namespace felt
