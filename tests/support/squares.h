#pragma once

#include <cstdint>

#include "core/mesh.h"

namespace felt::test {

/// A square of a side in the plane z, from (x, 0); metres.
inline TriangleMesh square(float x, float side, float z) {
  TriangleMesh mesh;
  mesh.positions = {{x, 0, z}, {x + side, 0, z}, {x + side, side, z}, {x, side, z}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  return mesh;
}

/// Vertices and triangles of two meshes in one.
inline TriangleMesh both(TriangleMesh a, const TriangleMesh& b) {
  const auto n = uint32_t(a.positions.size());
  a.positions.insert(a.positions.end(), b.positions.begin(), b.positions.end());
  for (const Triangle& t : b.triangles) a.triangles.push_back(t + Triangle::Constant(n));
  return a;
}

}  // namespace felt::test
