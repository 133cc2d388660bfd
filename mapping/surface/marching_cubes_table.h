#pragma once

#include <array>
#include <cstdint>

namespace felt {

/// Corner c of a cell is at offset (c >> 2, c >> 1 & 1, c & 1) from the cell's lowest voxel. Edge e = 4 axis + n runs
/// along `axis` from `corner`, the lower of its two ends.
struct CubeEdge {
  uint8_t axis;    ///< 0: x, 1: y, 2: z
  uint8_t corner;  ///< lower end
};
extern const std::array<CubeEdge, 12> kCubeEdges;

/// The triangles of one sign pattern, counter-clockwise seen from the positive side.
struct CubeCase {
  uint8_t triangles = 0;           ///< at most 5
  std::array<uint8_t, 15> edge{};  ///< three edge numbers each
};

/// Triangles for each pattern of negative corners (bit c: corner c is negative).
///
/// Marching cubes (Lorensen and Cline, SIGGRAPH 1987), with the table derived rather than listed: on every face each
/// run of negative corners is cut off by one segment, so that on an ambiguous face negative corners are separated; this
/// depends on the face alone, hence the two cells at a face agree and the mesh has no cracks. The segments close to
/// loops, and loops are triangulated without any diagonal inside a face, so that an edge never has more than two
/// triangles.
const std::array<CubeCase, 256>& cube_cases();

}  // namespace felt
